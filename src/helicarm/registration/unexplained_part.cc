// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/unexplained_part.h"

#include <algorithm>
#include <cmath>

namespace helicarm::registration {
namespace {

constexpr int tried_axes = 48;              // about 20 degrees apart
constexpr double largest_ray_cosine = 0.7;  // 45 degrees
constexpr int least_side_comparisons = 16;
constexpr double least_side_share = 0.1;
constexpr double farthest_radii = 6;            // of a plane from the model's centre, in its rms radius
constexpr double least_tried_difference = 0.2;  // a part is registered from it on
// Of a part alone: by how much it agrees better, how far from the pose of the whole, and in how many places
// of each view.
constexpr double least_part_gain = 0.15;
constexpr double least_part_motion_mm = 1;
constexpr int least_alone_comparisons = 8;

/// The bone's own, which go first where others separate as well, and directions spread evenly over half a
/// sphere, on a spiral.
std::vector<CutAxis> axes_of(const Model& model) {
  const double golden_angle = EIGEN_PI * (3 - std::sqrt(5.0));
  std::vector<CutAxis> axes = cut_axes_of(model);
  for (int i = 0; i < tried_axes; ++i) {
    const double z = (i + 0.5) / tried_axes, radius = std::sqrt(1 - z * z), angle = golden_angle * i;
    axes.push_back({model.centre, {radius * std::cos(angle), radius * std::sin(angle), z}});
  }
  return axes;
}

/// What is compared on one side of a plane in one view.
struct Side {
  int count = 0;
  double weight = 0, agreement = 0;  ///< sums

  void add(double value, double by) {
    ++count;
    weight += by;
    agreement += by * value;
  }
  double mean() const { return agreement / weight; }
};

struct Sides {
  Side lower, upper;

  Sides(const std::vector<Along>& view, double plane_mm) {
    for (const Along& each : view) (each.at_mm > plane_mm ? upper : lower).add(each.agreement, each.weight);
  }
  double weight() const { return lower.weight + upper.weight; }
  bool are_compared() const {
    return std::min(lower.count, upper.count) >= least_side_comparisons && weight() > 0 &&
           std::min(lower.weight, upper.weight) >= least_side_share * weight();
  }
  double difference() const { return lower.mean() - upper.mean(); }
  double variance_between() const {
    return lower.weight * upper.weight / (weight() * weight()) * difference() * difference();
  }
};

struct Compared {
  double difference = 0;  ///< lower - upper, mean over the views
  double variance = 0;    ///< between the sides, sum over the views
};

std::optional<Compared> compared_at(const std::vector<std::vector<Along>>& views, double plane_mm) {
  Compared result;
  for (const std::vector<Along>& view : views) {
    const Sides sides(view, plane_mm);
    if (!sides.are_compared()) return std::nullopt;
    result.difference += sides.difference() / double(views.size());
    result.variance += sides.variance_between();
  }
  return result;
}

double reach_of(const std::vector<std::vector<Along>>& views, double most) {
  double reach = 0;
  for (const std::vector<Along>& view : views)
    for (const Along& each : view) reach = std::max(reach, std::abs(each.at_mm));
  return std::min(reach, most);
}

/// The plane that separates best of those on whose sides the agreement differs enough.
std::optional<UnexplainedPart> doubtful_part(const Model& model, const std::vector<RegistrationView>& views,
                                             const Registration& found) {
  std::optional<UnexplainedPart> best;
  double largest = 0;
  for (const CutAxis& axis : axes_of(model)) {
    const auto along = agreements_along(axis, views, found, largest_ray_cosine);
    const double reach = reach_of(along, farthest_radii * model.radius_mm);
    for (double plane = -reach; plane < reach; plane += plane_step_mm) {
      const auto compared = compared_at(along, plane);
      if (!compared || !(std::abs(compared->difference) >= least_tried_difference) ||
          !(compared->variance > largest))
        continue;
      largest = compared->variance;
      best = {{axis, plane}, compared->difference > 0};
    }
  }
  if (!best) return best;
  const double share = 1 / double(views.size());
  for (const auto& view : agreements_along(best->cut.axis, views, found, largest_ray_cosine)) {
    const Sides sides(view, best->cut.at_mm);
    best->agreements.push_back((best->is_upper ? sides.upper : sides.lower).mean());
    best->agreements_elsewhere.push_back((best->is_upper ? sides.lower : sides.upper).mean());
    best->agreement += share * best->agreements.back();
    best->agreement_elsewhere += share * best->agreements_elsewhere.back();
  }
  return best;
}

std::optional<PartAlone> alone(const Model& model, const UnexplainedPart& of, const Registration& found,
                               const RegisterPart& register_part) {
  const auto part = part_beyond(model, of.cut, of.is_upper);
  if (!part) return std::nullopt;
  const Registration own = register_part(*part, found.world_from_model);
  PartAlone result;
  for (const RegisteredView& view : own.views) {
    Side side;
    for (const LocalAgreement& each : view.agreements) side.add(each.agreement, each.weight);
    if (side.count < least_alone_comparisons) return std::nullopt;
    result.agreement += side.mean() / double(own.views.size());
  }
  result.moved_mm = separation(*part, found.world_from_model, own.world_from_model);
  result.turned_deg = turn_between_deg(found.world_from_model, own.world_from_model);
  if (own.failure) result.refused = own.failure->reason;
  return result;
}

bool agrees_elsewhere(const UnexplainedPart& part) {
  return part.alone && part.alone->agreement - part.agreement >= least_part_gain &&
         part.alone->moved_mm >= least_part_motion_mm;
}

}  // namespace

std::optional<UnexplainedPart> unexplained_part(const Model& model,
                                                const std::vector<RegistrationView>& views,
                                                const Registration& found,
                                                const RegisterPart& register_part) {
  if (model.surface || views.size() < 2) return std::nullopt;
  auto part = doubtful_part(model, views, found);
  if (!part) return std::nullopt;
  const auto places = divided(model, part->cut);
  if (!places) return std::nullopt;
  part->section = places->section;
  part->centre = part->is_upper ? places->upper : places->lower;
  part->centre_of_rest = part->is_upper ? places->lower : places->upper;
  if (register_part) part->alone = alone(model, *part, found, register_part);
  if (part->difference() < clear_difference && !agrees_elsewhere(*part)) return std::nullopt;
  return part;
}

}  // namespace helicarm::registration
