// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/bones.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/volume/label_map.h"

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

/// The patient direction that is nearest.
std::string direction_word(const Vector3d& direction) {
  Eigen::Index axis = 0;
  direction.cwiseAbs().maxCoeff(&axis);
  constexpr std::array positive{"left", "posterior", "superior"}, negative{"right", "anterior", "inferior"};
  return direction[axis] > 0 ? positive[std::size_t(axis)] : negative[std::size_t(axis)];
}

/// The choice of a label map's only label.
std::map<std::string, std::vector<int>> only_label(const volume::Volume& map, const std::string& origin) {
  const auto labels = volume::labels_in(map);
  if (!labels || labels->empty()) value_or_throw(volume::check_labels(map, std::array{1}, origin));
  value_or_throw(volume::one_label(*labels, origin, "--label NAME=N"));
  return {{"bone", {labels->begin()->first}}};
}

/// Numbers behind `NAME=`, apart by commas.
template <class Number>
std::pair<std::string, std::vector<Number>> named_numbers(const std::string& text, const std::string& form) {
  const auto refuse = [&] { throw BadInput(Reason::usage, fmt::format("\"{}\" is not {}", text, form)); };
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0) refuse();
  std::pair<std::string, std::vector<Number>> named{text.substr(0, equals), {}};
  for (const char *at = text.data() + equals, *end = text.data() + text.size(); at < end;) {
    ++at;  // '=' or ','
    if (at < end && *at == '+') ++at;
    Number number{};
    const auto [stop, error] = std::from_chars(at, end, number);
    if (error != std::errc{} || (stop < end && *stop != ',') || !std::isfinite(double(number))) refuse();
    named.second.push_back(number);
    at = stop;
  }
  return named;
}

}  // namespace

Expected<void> check_name(const std::string& name) {
  constexpr std::size_t longest = 64;
  const bool good = std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
  });
  if (good && !name.empty() && name.size() <= longest) return {};
  return fail(
      Reason::bad_value,
      fmt::format("the bone's name \"{}\" becomes a file's: it must be 1 to {} letters, digits, - or _", name,
                  longest));
}

void measure_bones(Segmentation& made) {
  for (Bone& bone : made.bones) bone.low = made.size, bone.high = Vector3i::Constant(-1);
  std::vector<Bone*> of_label(256, nullptr);
  for (Bone& bone : made.bones) of_label[bone.label] = &bone;
  std::vector<Vector3d> sums(256, Vector3d::Zero());
  std::size_t i = 0;
  for (int z = 0; z < made.size.z(); ++z)
    for (int y = 0; y < made.size.y(); ++y)
      for (int x = 0; x < made.size.x(); ++x, ++i) {
        Bone* bone = of_label[made.labels[i]];
        if (!bone) continue;
        const Vector3i voxel(x, y, z);
        const Vector3d at = made.patient_from_voxel * voxel.cast<double>();
        ++bone->voxels;
        bone->low = bone->low.cwiseMin(voxel);
        bone->high = bone->high.cwiseMax(voxel);
        bone->box.extend(at);
        sums[bone->label] += at;
      }
  const double voxel_cm3 = std::abs(made.patient_from_voxel.linear().determinant()) / 1000;
  for (Bone& bone : made.bones) {
    if (bone.voxels == 0) continue;
    bone.volume_cm3 = double(bone.voxels) * voxel_cm3;
    bone.centre = sums[bone.label] / double(bone.voxels);
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d along = made.patient_from_voxel.linear().col(axis);
      if (bone.low[axis] == 0) bone.cut_off.push_back(direction_word(-along));
      if (bone.high[axis] == made.size[axis] - 1) bone.cut_off.push_back(direction_word(along));
    }
    if (!bone.cut_off.empty())
      made.notes.push_back(
          {Reason::bone_cut_off,
           fmt::format("{}: reaches the volume's {} face{}: it is cut off there, or only touches it",
                       bone.name, fmt::join(bone.cut_off, " and "), bone.cut_off.size() > 1 ? "s" : ""),
           {},
           {{"faces", double(bone.cut_off.size())}}});
  }
}

Expected<Seed> seed_from(const std::string& text) {
  return guarded([&] {
    const std::string form = "NAME=x,y,z: a bone's name and a point of it, mm";
    const auto [name, numbers] = named_numbers<double>(text, form);
    if (numbers.size() != 3) throw BadInput(Reason::usage, fmt::format("\"{}\" is not {}", text, form));
    return Seed{name, Vector3d::Map(numbers.data())};
  });
}

Expected<std::pair<std::string, std::vector<int>>> choice_from(const std::string& text) {
  return guarded([&] {
    const std::string form = "NAME=N or NAME=N,M: a bone's name and its labels, from 1 on";
    auto chosen = named_numbers<int>(text, form);
    if (std::ranges::min(chosen.second) < 1)
      throw BadInput(Reason::usage, fmt::format("\"{}\" is not {}", text, form));
    return chosen;
  });
}

Expected<Segmentation> segmentation_from(const volume::Volume& ct, volume::Volume map,
                                         const std::map<std::string, std::vector<int>>& chosen,
                                         const std::string& origin) {
  return guarded([&] {
    if (!volume::onto_grid(map, ct))
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: the label map has {} x {} x {} voxels, the CT {} x {} x {}, or they lie "
                      "elsewhere; resample the label map to the CT",
                      origin, map.size.x(), map.size.y(), map.size.z(), ct.size.x(), ct.size.y(),
                      ct.size.z()));
    Segmentation made{ct.size, ct.patient_from_voxel, std::vector<std::uint8_t>(map.voxels.size(), 0),
                      {},      std::nullopt,          map.warnings,
                      {}};
    std::vector<std::uint8_t> bone_of(65536, 0);
    for (const auto& [name, labels] : chosen.empty() ? only_label(map, origin) : chosen) {
      value_or_throw(check_name(name));
      value_or_throw(volume::check_labels(map, labels, origin));
      if (made.bones.size() == most_bones)
        throw BadInput(Reason::bad_size, fmt::format("over {} bones", most_bones));
      Bone& bone = made.bones.emplace_back();
      bone.name = name;
      bone.label = static_cast<std::uint8_t>(made.bones.size());
      for (const int label : labels)
        if (auto& taken = bone_of[std::size_t(label)]; taken != 0 && taken != bone.label)
          throw BadInput(Reason::name_clash, fmt::format("{}: label {} is asked for as {} and as {}", origin,
                                                         label, made.bones[taken - 1U].name, name));
        else
          taken = bone.label;
    }
    for (std::size_t i = 0; i < map.voxels.size(); ++i)
      made.labels[i] = bone_of[static_cast<std::size_t>(map.voxels[i])];
    measure_bones(made);
    return made;
  });
}

}  // namespace helicarm::segmentation
