// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/migrate.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/migration/match.h"
#include "helicarm/migration/mismatch.h"
#include "helicarm/track/body_pose.h"
#include "helicarm/track/body_series.h"

namespace helicarm::migration {
namespace {

constexpr double degrees = 180 / EIGEN_PI;
constexpr double line_mm =
    0.5;  // of markers about their common line: below, the turn about it is not determined
constexpr double small_segment_mm = 10;  // radiostereometry spreads a segment's markers over more

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

/// Pairs with their stated errors, turned into the second examination by `rotation`.
std::vector<Pair> pairs_of(const std::vector<Marker>& first, const std::vector<Marker>& second,
                           const Eigen::Matrix3d& rotation) {
  std::vector<Pair> pairs;
  for (std::size_t n = 0; n < first.size(); ++n) {
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    if (first[n].covariance) spread += rotation * *first[n].covariance * rotation.transpose();
    if (second[n].covariance) spread += *second[n].covariance;
    pairs.push_back({first[n].place, second[n].place, spread});
  }
  return pairs;
}

struct Matched {
  MatchedSegment segment;
  std::vector<Marker> first, second;

  void refit() {
    segment.fit = fit_rigid(pairs_of(first, second, Eigen::Matrix3d::Identity()));
    segment.fit = fit_rigid(pairs_of(first, second, segment.fit.second_from_first.rotation));
  }
  void leave_out(std::size_t n) {
    segment.loose.push_back(first[n].name);
    first.erase(first.begin() + std::ptrdiff_t(n));
    second.erase(second.begin() + std::ptrdiff_t(n));
  }
};

/// Refuses a set that is no rigid body within the guideline's limit; one loose marker is left out.
void require_rigid(Matched& matched, std::vector<Warning>& warnings) {
  const RigidFit whole = matched.segment.fit;
  if (whole.mean_error_mm <= mean_error_limit_mm) return;
  std::optional<Matched> best;
  for (std::size_t n = 0; matched.first.size() > 3 && n < matched.first.size(); ++n) {
    Matched without = matched;
    without.leave_out(n);
    without.refit();
    if (!best || without.segment.fit.mean_error_mm < best->segment.fit.mean_error_mm)
      best = std::move(without);
  }
  if (!best || best->segment.fit.mean_error_mm > mean_error_limit_mm)
    throw BadInput(
        {Reason::residual_too_large,
         fmt::format("segment \"{}\": mean error of rigid-body fitting {:.2f} mm, limit {:g} mm: its markers "
                     "are loose, or some are exchanged",
                     matched.segment.name, whole.mean_error_mm, mean_error_limit_mm),
         {},
         {{"mean_error_mm", whole.mean_error_mm}}});
  matched = std::move(*best);
  warnings.push_back(
      {Reason::marker_loose,
       fmt::format("segment \"{}\": mean error of rigid-body fitting {:.2f} mm, limit {:g} mm; "
                   "{:.2f} mm without \"{}\", which is left out: it moved in its segment",
                   matched.segment.name, whole.mean_error_mm, mean_error_limit_mm,
                   matched.segment.fit.mean_error_mm, matched.segment.loose.back()),
       {},
       {{"mean_error_mm", whole.mean_error_mm}}});
}

void require_spread(const std::string& name, const std::vector<Marker>& markers) {
  std::vector<Eigen::Vector3d> places;
  for (const Marker& marker : markers) places.push_back(marker.place);
  const double off_line = places.size() < 3 ? 0 : track::extents(places)[1];
  if (places.size() >= 3 && !(off_line > line_mm))
    throw BadInput(
        {Reason::body_ill_conditioned,
         fmt::format("segment \"{}\": its markers are within {:.2f} mm of one line, limit {:g} mm: "
                     "its rotation about the line is not determined{}",
                     name, off_line, line_mm, off_line < 0.1 * line_mm ? "; are its coordinates in mm?" : ""),
         {},
         {{"off_line_mm", off_line}}});
}

double farthest_mm(const std::vector<Eigen::Vector3d>& places) {
  double most = 0;
  for (const Eigen::Vector3d& a : places)
    for (const Eigen::Vector3d& b : places) most = std::max(most, (a - b).norm());
  return most;
}

/// A marker of the segment that either examination lacks is named.
void warn_of_missing(const Segment& segment, const std::vector<std::string>& missing, const std::string& where,
                     std::vector<Warning>& warnings) {
  if (missing.empty()) return;
  warnings.push_back({Reason::marker_lost,
                      fmt::format("segment \"{}\": {} of {} markers have no {}: {}", segment.name,
                                  missing.size(), segment.markers.size(), where, fmt::join(missing, ", ")),
                      {},
                      {}});
}

/// The segment's markers that the first examination located.
std::vector<Marker> located_markers(const Exam& first, const Segment& segment, std::vector<std::string>& missing,
                                    std::vector<Warning>& warnings) {
  for (const std::string& marker : segment.markers)
    if (!first.find(marker)) missing.push_back(marker);
  std::vector<Marker> located = markers_of(first, segment);
  if (located.size() < 3)
    throw BadInput(Reason::too_few_fiducials,
                   fmt::format("segment \"{}\": {} of its {} markers have a place in {}, three are needed",
                               segment.name, located.size(), segment.markers.size(), first.name));
  warn_of_missing(segment, missing, "place in " + first.name, warnings);
  return located;
}

Matched matched_as_given(const Exam& first, const Exam& second, const Segment& segment, Matching matching,
                         std::vector<Warning>& warnings) {
  Matched matched;
  const std::vector<Marker> of_first = located_markers(first, segment, matched.segment.missing, warnings),
                            of_second = candidates_for(second, segment.name);
  require_spread(segment.name, of_first);
  const std::string what = fmt::format("segment \"{}\"", segment.name);
  const Match match = value_or_throw(matching == Matching::name
                                         ? match_by_name(what, of_first, of_second)
                                         : match_by_geometry(what, of_first, of_second, largest_shift_mm));
  matched.segment.name = segment.name;
  for (std::size_t n = 0; n < match.first.size(); ++n) {
    matched.first.push_back(of_first[match.first[n]]);
    matched.second.push_back(of_second[match.second[n]]);
  }
  std::vector<std::string> alone;
  for (std::size_t i = 0; i < of_first.size(); ++i)
    if (std::ranges::count(match.first, i) == 0) alone.push_back(of_first[i].name);
  warn_of_missing(segment, alone, "partner in " + second.name, warnings);
  matched.segment.missing.insert(matched.segment.missing.end(), alone.begin(), alone.end());
  require_spread(segment.name, matched.first);
  matched.refit();
  require_rigid(matched, warnings);
  require_spread(segment.name, matched.first);
  for (std::size_t n = 0; n < matched.first.size(); ++n) {
    matched.segment.first.push_back(matched.first[n].name);
    matched.segment.second.push_back(matched.second[n].name);
    matched.segment.places.push_back(matched.first[n].place);
    for (const Marker* marker : {&matched.first[n], &matched.second[n]})
      if (marker->ray_gap_mm)
        matched.segment.ray_gap_mm = std::max(matched.segment.ray_gap_mm.value_or(0), *marker->ray_gap_mm);
  }
  matched.segment.condition_per_m = track::condition_per_m(matched.segment.places);
  if (matched.segment.condition_per_m > condition_limit_per_m)
    warnings.push_back({Reason::body_ill_conditioned,
                        fmt::format("{}: condition number {:.0f} per metre, limit {:g}: its markers are too "
                                    "near one line or each other for its rotations{}",
                                    what, matched.segment.condition_per_m, condition_limit_per_m,
                                    farthest_mm(matched.segment.places) < small_segment_mm
                                        ? "; all lie within 10 mm: are the coordinates in mm?"
                                        : ""),
                        {},
                        {{"condition_per_m", matched.segment.condition_per_m}}});
  return matched;
}

Matched matched_segment(const Exam& first, const Exam& second, const Segment& segment, Matching matching,
                        std::vector<Warning>& warnings) {
  try {
    return matched_as_given(first, second, segment, matching, warnings);
  } catch (const BadInput& bad) {
    Failure failure = bad.failure();
    const bool is_open = failure.reason == Reason::too_few_fiducials ||
                         failure.reason == Reason::ambiguous_labels ||
                         failure.reason == Reason::residual_too_large;
    const std::string cause =
        is_open ? mismatch_cause(markers_of(first, segment), second, segment.name) : std::string();
    if (cause.empty()) throw;
    failure.message += "; " + cause;
    throw BadInput(failure);
  }
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

double student_975(double freedom) {
  if (freedom < 1.5) return 12.7062;
  if (freedom < 2.5) return 4.30265;
  if (freedom < 3.5) return 3.18245;
  // Abramowitz and Stegun 26.7.5.
  constexpr double z = normal_at_975;
  const double z3 = z * z * z, z5 = z3 * z * z, z7 = z5 * z * z;
  return z + (z3 + z) / (4 * freedom) + (5 * z5 + 16 * z3 + 3 * z) / (96 * std::pow(freedom, 2)) +
         (3 * z7 + 19 * z5 + 17 * z3 - 15 * z) / (384 * std::pow(freedom, 3));
}

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
