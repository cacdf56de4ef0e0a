// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "helicarm/core/field.h"
#include "helicarm/pipeline/progress.h"
#include "helicarm/volume/volume.h"

namespace helicarm::segmentation {

/// A click on a bone: a point in it or on its cortex.
struct Seed {
  std::string name;                                 ///< of the bone: letters, digits, - and _, at most 64
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< volume's patient frame (L, P, S), mm
};

struct SegmentOptions {
  std::optional<double> threshold_hu = {};  ///< nothing: `usual_threshold`
  double gap_mm = 1;                        ///< half the width of gaps in the cortex that are closed
  /// Parts are one bone where the neck between them has this share of the smaller one's radius near it, or
  /// two thirds of that where the neck has a length, as a femur's has
  double neck = 0.6;
};

inline constexpr std::array<Field<SegmentOptions>, 3> segment_fields{
    bound<&SegmentOptions::threshold_hu>(
        {.name = "threshold_hu",
         .flag = "--threshold",
         .unit = "HU",
         .range = {-1000, 30000},
         .help = "Bone is what has at least this value, HU; default: 200, more in a noisy CT"}),
    bound<&SegmentOptions::gap_mm>(
        {.name = "gap_mm",
         .flag = "--gap",
         .unit = "mm",
         .range = {0, 10},
         .help = "Gaps of the cortex up to twice this width do not open the marrow cavity, mm"}),
    bound<&SegmentOptions::neck>(
        {.name = "neck",
         .flag = "--neck",
         .range = {0.05, 0.75},
         .help =
             "Parts are one bone where the neck between them has at least this share of the smaller "
             "part's radius within four times the neck's own; two thirds of that if the neck is long, as a "
             "femur's"})};

/// Where a bone meets another one.
struct Contact {
  std::string with;     ///< a bone with a seed; empty: bone without
  double with_cm3 = 0;  ///< its volume
  double neck_mm = 0;   ///< radius of the contact
  double width = 0;     ///< the same, relative to the smaller bone's greatest radius near the contact
  Eigen::Vector3d at = Eigen::Vector3d::Zero();
};

struct Bone {
  std::string name;
  std::uint8_t label = 0;  ///< in `Segmentation::labels`
  std::optional<Eigen::Vector3d> seed = {};
  std::optional<double> seed_hu = {};
  std::size_t voxels = 0;
  double volume_cm3 = 0;
  Eigen::Vector3i low = Eigen::Vector3i::Zero(), high = Eigen::Vector3i::Zero();  ///< voxels
  Eigen::AlignedBox3d box;                                                        ///< of voxel centres, mm
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  std::vector<std::string> cut_off = {};  ///< faces of the volume that it reaches: "superior", ...
  std::vector<Contact> contacts = {};     ///< the widest with each other bone
  /// Bone without a seed that hangs together with it, also by way of other bones: not in the mask.
  double left_out_cm3 = 0;
  double left_out_percent = 0;  ///< of all that hangs together
};

/// Bones on the grid of their CT.
struct Segmentation {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  std::vector<std::uint8_t> labels;  ///< 0: none of these bones
  std::vector<Bone> bones;
  std::optional<double> threshold_hu;  ///< nothing: from a label map
  std::vector<Warning> warnings, notes;
};

inline constexpr std::size_t most_bones = 250;

/// 200 HU, or more where soft tissue is so noisy that its voxels would reach it: its mode plus four standard
/// deviations, at most 400.
double usual_threshold(const volume::Volume& ct);

/// The bones at the seeds: voxels from a threshold on with the cavities they enclose, separated by a
/// watershed on the distance to their surface, in which every other bone competes: where the neck between two
/// parts is narrow in comparison with both close by. The axes' order and sense in memory change nothing. Time
/// grows with the number of voxels, memory is 11 bytes for each beside the CT, and 4 where its axes run
/// otherwise than L, P, S. Warns of contacts that are nearly as wide as a bone and of bones that are nearly
/// two (bones_in_contact), notes bones that the volume cuts off (bone_cut_off). Fails with bad_value (name,
/// threshold, a seed outside the volume), name_clash, seed_off_bone, seeds_in_one_bone.
Expected<Segmentation> segment(const volume::Volume& ct, std::span<const Seed> seeds,
                               const SegmentOptions& options, const pipeline::Progress& progress = {});

/// Bones of a label map of another program, which must have the grid of the CT (`volume::onto_grid`).
/// `chosen`: the labels of each bone; empty: a map with one label is taken as "bone". Fails with bad_value,
/// name_clash.
Expected<Segmentation> segmentation_from(const volume::Volume& ct, volume::Volume map,
                                         const std::map<std::string, std::vector<int>>& chosen,
                                         const std::string& origin);

/// `NAME=x,y,z`, and `NAME=N` or `NAME=N,M`; anything else is a `usage` failure.
Expected<Seed> seed_from(const std::string& text);
Expected<std::pair<std::string, std::vector<int>>> choice_from(const std::string& text);

}  // namespace helicarm::segmentation
