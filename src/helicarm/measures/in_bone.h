// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/measures/in_space.h"
#include "helicarm/measures/zones.h"

namespace helicarm::measures {

/// A view that is further from a true lateral one is not meant as one.
inline constexpr double nearly_lateral_deg = 30;
/// Condyles 50 mm apart are then 6 degrees off: a tenth of the condyles' depth.
inline constexpr double most_apart_mm = 5;

struct NamedView {
  std::string name;
  geometry::View view;
};

/// Where points lie in one image, per cent of the images of the landmarks.
struct InImage {
  std::string view;
  std::vector<Position> positions;
};

/// A view beside the true lateral one of a bone.
struct LateralView {
  std::string view;
  Lateral lateral;
  bool is_lateral;                  ///< the axis' ends are at most `most_apart_mm` apart
  std::vector<Position> projected;  ///< of the projected landmarks and points; empty: not determined
};

/// A measure in a bone, its positions against zones, and the views that are nearly lateral.
struct InBone {
  std::string name, model;
  Measure measure;
  std::vector<std::vector<ZoneFit>> zones;  ///< by positions
  std::vector<LateralView> laterals = {};
  std::vector<InImage> clicked = {};      ///< per cent of landmarks that are clicked in one image
  std::vector<std::string> missing = {};  ///< points that were to be measured and are not located
};

/// The views within `nearly_lateral_deg` of the axis between the landmarks `axis_medial` and `axis_lateral`;
/// none without an axis.
std::vector<LateralView> lateral_views(Kind kind, std::span<const Landmark> landmarks,
                                       const geometry::RigidTransform& world_from_bone,
                                       std::span<const NamedView> views);

/// Refuses as `measure_in_space`, the message naming the measure. Without a pose: no lateral views.
Expected<InBone> measure_in_bone(const std::string& name, const std::string& model, Kind kind,
                                 std::span<const Landmark> landmarks, std::span<const Zone> zones,
                                 const std::optional<geometry::RigidTransform>& world_from_bone = {},
                                 std::span<const NamedView> views = {});

/// The zones of a file, or those that are built in.
Expected<std::vector<Zone>> zones_of(const std::optional<std::filesystem::path>& file);

/// As `measures::to_json`, with "name", "model", "view" (null), "positions[].zones", "positions[].warnings",
/// "laterals", "clicked"
/// and "missing".
Json to_json(const InBone& measure);

/// A line for a user.
struct Line {
  std::string text;
  int depth = 0;  ///< of indentation
  bool is_warning = false;
};

/// "LAT: 2.1 degrees off a true lateral image, the axis' ends 1.2 mm apart".
std::string sentence_of(const LateralView& view);
std::vector<Line> lines_of(const InBone& measure);

}  // namespace helicarm::measures
