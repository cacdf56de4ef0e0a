// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/migrate.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/migration/matched.h"
#include "helicarm/track/body_pose.h"
#include "helicarm/track/body_series.h"

namespace helicarm::migration {
namespace {

constexpr double degrees = 180 / EIGEN_PI;

/// Markers that were asked for by name must have a place.
void require_places(const Exam& exam, const std::vector<Segment>& segments) {
  for (const Segment& segment : segments)
    for (const std::string& marker : segment.markers)
      if (!exam.find(marker))
        throw BadInput(Reason::bad_value, fmt::format("segment \"{}\": {} has no marker \"{}\" with a place",
                                                      segment.name, exam.name, marker));
}

std::vector<Segment> segments_of(const Exam& first, const MigrationOptions& options) {
  require_places(first, options.segments);
  std::vector<Segment> segments = options.segments.empty() ? first.segments : options.segments;
  if (segments.size() < 2)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: {} segments: a migration is that of one rigid set of markers against "
                               "another: give a column segment, or --segment NAME=M1,M2,M3 for each",
                               first.name, segments.size()));
  for (std::size_t i = 0; i < segments.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) {
      if (segments[i].name == segments[k].name)
        throw BadInput(Reason::name_clash, fmt::format("segment \"{}\" is given twice", segments[i].name));
      for (const std::string& marker : segments[i].markers)
        if (std::ranges::count(segments[k].markers, marker) > 0)
          throw BadInput(Reason::name_clash, fmt::format("\"{}\" is in the segments \"{}\" and \"{}\"",
                                                         marker, segments[k].name, segments[i].name));
    }
  if (!options.reference.empty()) {
    const auto reference = std::ranges::find(segments, options.reference, &Segment::name);
    if (reference == segments.end())
      throw BadInput(Reason::bad_value,
                     fmt::format("reference: \"{}\" is no segment of {}", options.reference, first.name));
    std::rotate(segments.begin(), reference, reference + 1);
  }
  return segments;
}

/// No marker of the second examination serves two segments.
void require_own_markers(const std::vector<Matched>& all) {
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t k = 0; k < i; ++k)
      for (const std::string& marker : all[i].segment.second)
        if (std::ranges::count(all[k].segment.second, marker) > 0)
          throw BadInput(
              Reason::ambiguous_labels,
              fmt::format("the segments \"{}\" and \"{}\" both fit the marker \"{}\" of the second "
                          "examination: name the segments there too, or match by name",
                          all[k].segment.name, all[i].segment.name, marker));
}

/// A second measurement differs in every digit that counts: the same places are the same file, or a copy.
void require_two_examinations(const Exam& first, const Exam& second, const std::vector<Matched>& all) {
  double largest_mm = 0;
  for (const Matched& each : all)
    for (std::size_t n = 0; n < each.first.size(); ++n)
      largest_mm =
          std::max(largest_mm, (each.second[n].place - each.first[n].place).lpNorm<Eigen::Infinity>());
  if (largest_mm > same_place_mm) return;
  throw BadInput({Reason::bad_value,
                  fmt::format("{} and {} are the same examination: no coordinate of a marker differs by more "
                              "than {:g} mm",
                              first.name, second.name, same_place_mm),
                  {},
                  {{"largest_mm", largest_mm}, {"limit", same_place_mm}}});
}

Eigen::Vector3d middle_of(const std::vector<Marker>& markers) {
  std::vector<Eigen::Vector3d> places;
  for (const Marker& marker : markers) places.push_back(marker.place);
  return geometry::mean_of(places);
}

/// Both examinations are in mm: segments that are larger in one by the same share show its calibration.
std::optional<Warning> scale_between(const std::vector<Matched>& all, const std::string& second) {
  constexpr double least = 0.002, sigmas = 4;
  double along = 0, squares = 0, seconds = 0, freedom = -1;
  for (const Matched& each : all) {
    const Eigen::Vector3d from = middle_of(each.first), to = middle_of(each.second);
    for (std::size_t n = 0; n < each.first.size(); ++n) {
      const Eigen::Vector3d a = each.segment.fit.second_from_first.rotation * (each.first[n].place - from);
      const Eigen::Vector3d b = each.second[n].place - to;
      along += a.dot(b);
      squares += a.squaredNorm();
      seconds += b.squaredNorm();
    }
    freedom += 3.0 * double(each.first.size()) - 6;
  }
  const double scale = along / squares;
  const double sigma = std::sqrt(std::max(0.0, seconds - scale * along) / std::max(1.0, freedom) / squares);
  if (freedom < 2 || std::abs(scale - 1) < std::max(least, sigmas * sigma)) return std::nullopt;
  return Warning{
      Reason::scale_disagrees,
      fmt::format("the segments are {:.2f} % {} in {} than in the first examination (standard "
                  "deviation {:.2f} %): the calibration of one has another scale, which displaces "
                  "what lies apart; check the cage's coordinates",
                  100 * std::abs(scale - 1), scale > 1 ? "larger" : "smaller", second, 100 * sigma),
      {},
      {{"scale", scale}, {"sigma", sigma}}};
}

/// The errors that the residuals show, where the examinations state none, or larger ones.
void take_errors(Migration& migration, std::vector<Matched>& all) {
  bool is_stated = true;
  double squares = 0, expected = 0, variance = 0;
  for (const Matched& each : all) {
    squares += each.segment.fit.squares_mm2;
    migration.freedom += 3.0 * double(each.first.size()) - 6;
    for (const auto* markers : {&each.first, &each.second})
      for (const Marker& marker : *markers) is_stated = is_stated && marker.covariance.has_value();
    expected += each.segment.fit.expected_squares_mm2;
    variance += each.segment.fit.squares_variance_mm4;
  }
  if (is_stated) {
    // Residuals that the stated errors do not explain (0.1 %) widen them. Errors differ: the squares are
    // about chi-square with the degrees of freedom that mean and variance give (Satterthwaite 1946).
    const double excess = squares / expected, freedom = 2 * expected * expected / variance;
    const double factor = excess * freedom > chi2_quantile(freedom, normal_at_999) ? excess : 1;
    for (Matched& each : all) each.segment.fit.covariance *= factor;
    if (factor > 1)
      migration.warnings.push_back(
          {Reason::residual_too_large,
           fmt::format("the markers' residuals are {:.1f} times their stated errors, which "
                       "are widened by as much",
                       std::sqrt(factor)),
           {},
           {{"ratio", std::sqrt(factor)}}});
    return;
  }
  migration.is_by_residuals = true;
  migration.width_of_95 = student_975(migration.freedom);
  for (Matched& each : all) {
    for (std::vector<Marker>* markers : {&each.first, &each.second})
      for (Marker& marker : *markers)
        marker.covariance = squares / migration.freedom / 2 * Eigen::Matrix3d::Identity();
    each.refit();
  }
}

/// Angles (rad) about the fixed axes x, then y, then z: the rotation is Rz Ry Rx.
Eigen::Vector3d angles_of(const Eigen::Matrix3d& r) {
  return {std::atan2(r(2, 1), r(2, 2)), std::asin(std::clamp(-r(2, 0), -1.0, 1.0)),
          std::atan2(r(1, 0), r(0, 0))};
}

/// d angles / d rotation vector of a further small rotation.
Eigen::Matrix3d angles_by_step(const Eigen::Matrix3d& rotation) {
  constexpr double step = 1e-5;
  Eigen::Matrix3d slope;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d by = step * Eigen::Vector3d::Unit(axis);
    slope.col(axis) = (angles_of(geometry::rotation_from_vector(by) * rotation) -
                       angles_of(geometry::rotation_from_vector(-by) * rotation)) /
                      (2 * step);
  }
  return slope;
}

BodyMigration migration_of(const std::vector<Matched>& all, std::size_t index, const Eigen::Matrix3d& axes) {
  const RigidFit &reference = all[0].segment.fit, &body = all[index].segment.fit;
  const track::FramePose relative =
      track::relative_pose({reference.second_from_first, reference.covariance}, reference.centre,
                           {body.second_from_first, body.covariance}, body.centre);
  BodyMigration body_migration{.segment = index, .motion = relative.pose};
  body_migration.centre = geometry::mean_of(all[index].segment.places);
  const Eigen::Matrix3d rotation = axes.transpose() * relative.pose.rotation * axes;
  body_migration.rotation_deg = degrees * angles_of(rotation);
  body_migration.translation_mm =
      axes.transpose() * (relative.pose * body_migration.centre - body_migration.centre);
  body_migration.turn_deg = degrees * geometry::vector_from_rotation(rotation).norm();
  registration::RigidCovariance slope = registration::RigidCovariance::Zero();
  slope.topLeftCorner<3, 3>() = angles_by_step(rotation) * axes.transpose();
  slope.bottomRightCorner<3, 3>() = axes.transpose();
  body_migration.covariance = slope * relative.covariance * slope.transpose();
  for (std::size_t n = 0; n < all[index].first.size(); ++n) {
    const Eigen::Vector3d &position = all[index].first[n].place, now = relative.pose * position;
    const Eigen::Vector3d motion = now - position;
    if (n > 0 && motion.norm() <= body_migration.mtpm_mm) continue;
    const auto by_step = track::point_by_step(now, relative.pose * body_migration.centre);
    const Eigen::Vector3d along = motion.norm() > 0 ? motion.normalized() : Eigen::Vector3d::UnitX();
    body_migration.mtpm_mm = motion.norm();
    body_migration.mtpm_sigma_mm =
        std::sqrt(along.dot(by_step * relative.covariance * by_step.transpose() * along));
    body_migration.mtpm_marker = all[index].first[n].name;
  }
  return body_migration;
}

}  // namespace

Expected<Migration> migrate(const Exam& first, const Exam& second, const MigrationOptions& options) {
  return guarded([&] {
    if (!(options.axes.transpose() * options.axes).isIdentity(1e-6) || !(options.axes.determinant() > 0))
      throw BadInput(Reason::bad_value,
                     "axes: x, y and z are not perpendicular, of length 1 and right-handed");
    Migration migration;
    std::vector<Matched> all;
    for (const Segment& segment : segments_of(first, options))
      all.push_back(matched_segment(first, second, segment, options.matching, migration.warnings));
    require_own_markers(all);
    require_two_examinations(first, second, all);
    if (auto warning = scale_between(all, second.name)) migration.warnings.push_back(*std::move(warning));
    take_errors(migration, all);
    for (std::size_t i = 1; i < all.size(); ++i)
      migration.bodies.push_back(migration_of(all, i, options.axes));
    for (Matched& each : all) migration.segments.push_back(std::move(each.segment));
    return migration;
  });
}

}  // namespace helicarm::migration
