// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/broken_bone.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace helicarm::registration {
namespace {

// Comparisons of a view on either side: those beside the plane do not count in a part, and at least 8 must.
constexpr int least_part_comparisons = 16;
constexpr double least_difference = 0.15;  // of the sides' agreement in a view: less is not worth the time
// Of the axis (30 degrees from the image's plane): beyond, the cut hides much of what lies beside it.
constexpr double largest_cosine_to_ray = 0.5;
// Parts of one piece were up to 1.7 mm apart: a shaft turns about itself.
constexpr double least_moved_mm = 2.5;
constexpr double least_moved_errors = 1.5;  // of both parts' 95 % errors together

/// Variance between the agreements on both sides of a plane, summed over the views; nothing where a side has
/// too few or the sides are alike.
std::optional<double> variance_between(const std::vector<std::vector<Along>>& views, double plane_mm) {
  double between = 0;
  bool is_different = false;
  for (const std::vector<Along>& view : views) {
    double sums[2] = {0, 0};
    int counts[2] = {0, 0};
    for (const Along& each : view) {
      sums[each.at_mm > plane_mm] += each.agreement;
      ++counts[each.at_mm > plane_mm];
    }
    if (std::min(counts[0], counts[1]) < least_part_comparisons) return std::nullopt;
    const double n = counts[0] + counts[1];
    const double difference = sums[0] / counts[0] - sums[1] / counts[1];
    is_different = is_different || std::abs(difference) >= least_difference;
    between += counts[0] / n * counts[1] / n * difference * difference;
  }
  return is_different ? std::optional(between) : std::nullopt;
}

/// The plane that separates what agrees from what does not best.
std::optional<CutPlane> separating_plane(const Model& model, const std::vector<RegistrationView>& views,
                                         const Registration& found) {
  std::optional<CutPlane> best;
  double largest = 0;
  std::vector<CutAxis> axes = cut_axes_of(model);
  measure_ends(model, axes);
  for (const CutAxis& axis : axes) {
    const auto along = agreements_along(axis, views, found, largest_cosine_to_ray);
    if (along.empty()) continue;
    for (double plane = axis.low; plane < axis.high; plane += plane_step_mm)
      if (const auto between = variance_between(along, plane); between && *between > largest) {
        best = {axis, plane};
        largest = *between;
      }
  }
  return best;
}

}  // namespace

std::optional<BrokenBone> broken_bone(const Model& model, const std::vector<RegistrationView>& views,
                                      const Registration& refused, const RegisterPart& register_part) {
  if (model.surface || views.size() < 2) return std::nullopt;
  const auto plane = separating_plane(model, views, refused);
  if (!plane) return std::nullopt;
  const bool is_upper_shorter = plane->axis.high - plane->at_mm < plane->at_mm - plane->axis.low;
  // One part after the other: each is as large as the model.
  std::optional<Model> part = part_beyond(model, *plane, !is_upper_shorter);
  if (!part) return std::nullopt;
  const Registration one = register_part(*part, refused.world_from_model);
  if (one.failure) return std::nullopt;
  const double error_of_longer_mm = worst_error_mm(*part, one);
  part = part_beyond(model, *plane, is_upper_shorter);
  if (!part) return std::nullopt;
  const Registration other = register_part(*part, one.world_from_model);
  if (other.failure) return std::nullopt;
  BrokenBone broken;
  broken.moved_mm = separation(*part, one.world_from_model, other.world_from_model);
  const double error_mm = std::hypot(error_of_longer_mm, worst_error_mm(*part, other));
  if (broken.moved_mm < std::max(least_moved_mm, least_moved_errors * error_mm)) return std::nullopt;
  broken.turned_deg = turn_between_deg(one.world_from_model, other.world_from_model);
  broken.cut = plane->middle();
  broken.end = plane->end(is_upper_shorter);
  broken.from_end_mm = std::abs(plane->end_mm(is_upper_shorter) - plane->at_mm);
  return broken;
}

}  // namespace helicarm::registration
