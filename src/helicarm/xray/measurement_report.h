// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/xray/patient_study.h"

namespace helicarm::xray {

/// An X-ray image as others refer to it.
struct ReportImage {
  PatientStudy patient_study;
  std::string series_uid;
  std::optional<int> frame = {};  ///< from 1; nothing: the file has one
};

/// Nothing for a file that is not DICOM or lacks the UID of its study, series or instance.
Expected<std::optional<ReportImage>> report_image_of(const std::filesystem::path& file,
                                                     std::optional<int> frame);

/// An entry of a coding scheme.
struct Code {
  std::string value, scheme;
  std::string meaning;  ///< at most 64 characters
};
/// Of this program, where no standard has one.
inline constexpr const char* own_scheme = "99HELICARM";

/// A place in one of the report's images.
struct ReportMark {
  std::size_t image;
  Eigen::Vector2d uv;  ///< pixels as stored; (0, 0): the centre of the first one
};

/// A number, or why there is none.
struct ReportValue {
  Code name;
  Code unit;  ///< UCUM
  std::optional<double> value;
  std::optional<double> sigma = {};
  std::optional<double> within_95 = {};    ///< half width of the 95 % interval
  std::vector<Eigen::Vector3d> path = {};  ///< mm: none, a point, or the corners of a line
  std::vector<ReportMark> marks = {};
  std::string comment = {};  ///< required without a value
};

/// What was measured of one thing.
struct ReportGroup {
  std::string name;
  Code finding;
  std::vector<ReportValue> values;
};

/// A measurement report (PS3.16 TID 1500) in Comprehensive 3D SR.
struct MeasurementReport {
  std::vector<ReportImage> images;     ///< at least one; the first one's patient and study are the report's
  std::string frame_of_reference_uid;  ///< of the paths
  std::vector<ReportGroup> groups;     ///< at least one
};

/// Writes it, atomically and readable by its owner alone. UIDs follow from the content. Refuses: bad_value
/// (no image, no group, a number that is not finite), cannot_write.
Expected<void> write_measurement_report(const std::filesystem::path& path, const MeasurementReport& report);

}  // namespace helicarm::xray
