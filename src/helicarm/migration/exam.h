// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"

namespace helicarm::migration {

/// A marker where one examination located it.
struct Marker {
  std::string name;
  Eigen::Vector3d place;                      ///< mm, laboratory
  std::optional<Eigen::Matrix3d> covariance;  ///< mm^2; nothing: not stated
  std::optional<double> ray_gap_mm;           ///< crossing-line distance
};

/// A rigid set of markers, by their names; an examination need not have located all of them.
struct Segment {
  std::string name;
  std::vector<std::string> markers;
};

/// One examination: located markers, and which of them belong together, if it says so.
struct Exam {
  std::string name;  ///< of its file, for messages
  std::vector<Marker> markers;
  std::vector<Segment> segments;

  const Marker* find(const std::string& marker) const;
};

/// Those of the segment that have a place.
std::vector<Marker> markers_of(const Exam& exam, const Segment& segment);

/// Those of the segment of this name, where the examination names segments, or all.
std::vector<Marker> candidates_for(const Exam& exam, const std::string& segment);

/// Reads an examination:
/// - CSV `name,x_mm,y_mm,z_mm` and optional `sx_mm,sy_mm,sz_mm` (standard deviations), `ray_gap_mm`,
///   `segment`;
/// - markers.csv of `helicarm track` (a CSV with a column `frame`; its tracked places), or its folder, whose
///   track.json names the bodies; `frame`: which one, needed if there are several;
/// - result.json of `helicarm run`, or its folder: the located points.
/// Fails with missing_file, bad_value, name_clash, unknown_key, and as `read_csv`, `read_json`.
Expected<Exam> read_exam(const std::filesystem::path& path, std::optional<int> frame = {});

/// "NAME=M1,M2,..." as on the command line; bad_value for another form and for fewer than three markers.
Expected<Segment> segment_from(const std::string& text);
/// bad_value for an empty name and for fewer than three markers.
Expected<Segment> segment_of(std::string name, std::vector<std::string> markers);

}  // namespace helicarm::migration
