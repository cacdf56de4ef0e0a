// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/label_map.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/volume/axis_order.h"

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

bool onto_grid(Volume& map, const Volume& ct, bool may_be_part) {
  const Eigen::Affine3d ct_from_map = ct.patient_from_voxel.inverse() * map.patient_from_voxel;
  const Eigen::Matrix3d turn = ct_from_map.linear().array().round().matrix();
  const Eigen::Vector3d first = ct_from_map.translation().array().round().matrix();
  if (!(turn.cwiseAbs() * Eigen::Vector3d::Ones()).isOnes() ||
      !(turn.cwiseAbs().transpose() * Eigen::Vector3d::Ones()).isOnes())
    return false;
  const Volume there{map.size, {}, ct.patient_from_voxel * (Eigen::Translation3d(first) * turn), {}};
  if (!is_same_grid(map, there)) return false;
  const Eigen::Vector3d last = (map.size.cast<double>().array() - 1).matrix();
  // Between the first and the last voxel, which are corners of the CT or, of a part, lie within it.
  const Eigen::Vector3d low = first.cwiseMin(turn * last + first), high = first.cwiseMax(turn * last + first);
  const Eigen::Vector3d end = (ct.size.cast<double>().array() - 1).matrix();
  const bool is_whole = low == Eigen::Vector3d::Zero() && high == end;
  // One that begins with the CT's first voxel may only lack its own origin.
  const bool may_be_cut_out = may_be_part || low != Eigen::Vector3d::Zero();
  if (!is_whole && !(may_be_cut_out && low.minCoeff() >= 0 && (end - high).minCoeff() >= 0)) return false;
  map.patient_from_voxel = ct.patient_from_voxel;
  if (is_whole && turn.isIdentity()) return true;
  map.voxels = reordered(map.voxels, map.size, {turn.cast<int>(), first.cast<int>()}, ct.size);
  map.size = ct.size;
  return true;
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

Expected<void> choose_mask(Volume& mask, std::optional<int> label, std::optional<double> threshold,
                           const std::string& origin, const std::string& key) {
  const auto labels = labels_in(mask);
  if (threshold && labels)
    return fail(Reason::bad_value,
                fmt::format("{}: holds no shares: it takes no \"{}_threshold\"", origin, key));
  if (label) {
    const auto checked = check_labels(mask, std::span(&*label, 1), origin);
    if (checked)
      for (float& voxel : mask.voxels) voxel = voxel == static_cast<float>(*label) ? 1.0F : 0.0F;
    return checked;
  }
  if (labels) return one_label(*labels, origin, fmt::format("\"{}_label\"", key));
  const auto [least, greatest] = std::ranges::minmax(mask.voxels);
  const auto is_whole = [](float value) { return value == std::floor(value); };
  const bool are_shares = greatest <= 1 || std::ranges::all_of(mask.voxels, is_whole);
  if (!(least >= 0) || !(greatest <= largest_label) || !are_shares)
    return fail(
        Reason::bad_value,
        fmt::format("{}: its values, {:g} to {:g}, are neither labels nor shares; resample a label map "
                    "by its nearest voxel, which keeps its labels",
                    origin, least, greatest));
  if (!threshold)
    return fail(
        Reason::bad_value,
        fmt::format("{}: holds shares, as an interpolated mask: state from which one on a voxel is of "
                    "the body with \"{}_threshold\", such as 0.5",
                    origin, key));
  const double whole = greatest <= 1 ? 1 : greatest <= 255 ? 255 : double(largest_label);
  for (float& voxel : mask.voxels) voxel = double(voxel) >= *threshold * whole ? 1.0F : 0.0F;
  return {};
}

}  // namespace helicarm::volume
