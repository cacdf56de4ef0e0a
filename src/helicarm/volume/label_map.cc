// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/label_map.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace helicarm::volume {
namespace {

// TotalSegmentator has 117; a grey mask of 8 bits takes most of its 255 values.
constexpr std::size_t most_labels = 150;
constexpr float largest_label = 65535;

std::string list_of_labels(const std::map<int, std::size_t>& labels) {
  constexpr std::size_t most_named = 12;
  std::string list;
  std::size_t named = 0;
  for (const auto& [label, voxels] : labels) {
    if (named == most_named) return list + fmt::format(" and {} more", labels.size() - named);
    list += fmt::format("{}{} ({} voxels)", named++ == 0 ? "" : ", ", label, voxels);
  }
  return list;
}

}  // namespace

std::optional<std::map<int, std::size_t>> labels_in(const Volume& volume) {
  std::map<int, std::size_t> labels;
  const auto& voxels = volume.voxels;
  for (std::size_t from = 0, to = 1; from < voxels.size(); from = to++) {
    const float value = voxels[from];
    while (to < voxels.size() && voxels[to] == value) ++to;
    if (value == 0) continue;
    if (!(value >= 1 && value <= largest_label) || value != std::floor(value)) return std::nullopt;
    labels[int(value)] += to - from;
    if (labels.size() > most_labels) return std::nullopt;
  }
  return labels;
}

Expected<void> check_labels(const Volume& map, std::span<const int> chosen, const std::string& origin) {
  const auto labels = labels_in(map);
  if (!labels)
    return fail(
        Reason::bad_value,
        fmt::format("{}: is not a label map: values other than whole numbers from 0 to 65535, or over "
                    "{} of them",
                    origin, most_labels));
  for (const int label : chosen)
    if (!labels->contains(label))
      return fail(Reason::bad_value, fmt::format("{}: holds no label {}, but {}", origin, label,
                                                 labels->empty() ? "only 0" : list_of_labels(*labels)));
  return {};
}

Expected<void> one_label(const std::map<int, std::size_t>& labels, const std::string& origin,
                         const std::string& key) {
  if (labels.size() <= 1) return {};
  return fail(Reason::bad_value, fmt::format("{}: holds {} labels, {}: choose one with {}", origin,
                                             labels.size(), list_of_labels(labels), key));
}

Expected<void> choose_label(Volume& mask, std::optional<int> label, const std::string& origin,
                            const std::string& key) {
  if (label) {
    const auto checked = check_labels(mask, std::span(&*label, 1), origin);
    if (checked)
      for (float& voxel : mask.voxels) voxel = voxel == static_cast<float>(*label) ? 1.0F : 0.0F;
    return checked;
  }
  const auto labels = labels_in(mask);
  return labels ? one_label(*labels, origin, key) : Expected<void>{};
}

}  // namespace helicarm::volume
