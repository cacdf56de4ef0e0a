// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/statistics.h"
#include "helicarm/migration/exam.h"
#include "helicarm/migration/rigid_fit.h"

namespace helicarm::migration {

/// Limits of the guideline (Valstar et al., Acta Orthop 2005; ISO 16087:2013).
inline constexpr double condition_limit_per_m = 120;
inline constexpr double mean_error_limit_mm = 0.35;
/// A tenth of what radiostereometry resolves, above a file's rounding.
inline constexpr double same_place_mm = 1e-3;

enum class Matching { geometry, name };

struct MigrationOptions {
  std::vector<Segment> segments = {};  ///< of the first examination; empty: as its file names them
  std::string reference = {};          ///< the bone that counts as fixed; empty: the first segment
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< columns: x, y, z in the first examination
  Matching matching = Matching::geometry;
};

/// A segment in both examinations.
struct MatchedSegment {
  std::string name;
  std::vector<std::string> first, second;  ///< markers that count, by their names in each
  std::vector<std::string> missing;        ///< without a place in the first, or not found in the second
  std::vector<std::string> loose;          ///< moved in the segment, left out
  double condition_per_m = 0;              ///< Soderkvist and Wedin 1993
  std::optional<double> ray_gap_mm;        ///< largest crossing-line distance of its markers
  std::vector<Eigen::Vector3d> places;     ///< first examination, of `first`
  RigidFit fit;
};

/// Of one segment relative to the reference, in the first examination's laboratory.
struct BodyMigration {
  std::size_t segment = 0;  ///< in `Migration::segments`
  geometry::RigidTransform motion = {};
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();          ///< of its markers, first examination
  Eigen::Vector3d rotation_deg = Eigen::Vector3d::Zero();    ///< about the fixed axes x, then y, then z
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();  ///< of the centre, along the axes
  /// Of the six numbers: rad, then mm, along the axes.
  registration::RigidCovariance covariance = registration::RigidCovariance::Zero();
  double turn_deg = 0;                    ///< about the helical axis
  double mtpm_mm = 0, mtpm_sigma_mm = 0;  ///< maximum total point motion
  std::string mtpm_marker = {};
};

struct Migration {
  std::vector<MatchedSegment> segments;  ///< the reference first
  std::vector<BodyMigration> bodies;
  bool is_by_residuals =
      false;           ///< the covariances follow from the residuals: markers' errors are not stated
  double freedom = 0;  ///< degrees of freedom of these residuals
  double width_of_95 = normal_at_975;  ///< standard deviations of a 95 % interval
  std::vector<Warning> warnings;
};

/// Migration of every segment against the reference between two examinations. Markers correspond by geometry
/// or by name; their errors are taken as independent. Warnings: body_ill_conditioned (condition number over
/// the guideline's limit), marker_lost, marker_loose. Fails with bad_value for unknown names and
/// for the same examination twice (no coordinate differs by more than 0.001 mm), too_few_fiducials and
/// ambiguous_labels as `match_by_geometry`, body_ill_conditioned for markers on a line, and
/// residual_too_large where the mean error of rigid-body fitting exceeds the guideline's limit and no single
/// loose marker explains it.
Expected<Migration> migrate(const Exam& first, const Exam& second, const MigrationOptions& options);

}  // namespace helicarm::migration
