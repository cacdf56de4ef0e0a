// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/matched.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/migration/match.h"
#include "helicarm/migration/mismatch.h"
#include "helicarm/track/body_pose.h"

namespace helicarm::migration {
namespace {

constexpr double line_mm =
    0.5;  // of markers about their common line: below, the turn about it is not determined
constexpr double small_segment_mm = 10;  // radiostereometry spreads a segment's markers over more

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
void warn_of_missing(const Segment& segment, const std::vector<std::string>& missing,
                     const std::string& where, std::vector<Warning>& warnings) {
  if (missing.empty()) return;
  warnings.push_back({Reason::marker_lost,
                      fmt::format("segment \"{}\": {} of {} markers have no {}: {}", segment.name,
                                  missing.size(), segment.markers.size(), where, fmt::join(missing, ", ")),
                      {},
                      {}});
}

/// The segment's markers that the first examination located.
std::vector<Marker> located_markers(const Exam& first, const Segment& segment,
                                    std::vector<std::string>& missing, std::vector<Warning>& warnings) {
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

}  // namespace

void Matched::refit() {
  segment.fit = fit_rigid(pairs_of(first, second, Eigen::Matrix3d::Identity()));
  segment.fit = fit_rigid(pairs_of(first, second, segment.fit.second_from_first.rotation));
}

void Matched::leave_out(std::size_t n) {
  segment.loose.push_back(first[n].name);
  first.erase(first.begin() + std::ptrdiff_t(n));
  second.erase(second.begin() + std::ptrdiff_t(n));
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

}  // namespace helicarm::migration
