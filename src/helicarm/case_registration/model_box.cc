// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/model_box.h"

#include <algorithm>

#include <Eigen/LU>
#include <fmt/format.h>

namespace helicarm::case_registration {
namespace {

using Eigen::Vector3d;

/// What the points' file may be in, if they then lie inside; or nothing.
std::string other_reading(const ModelBox& box, const std::vector<PlacedPoint>& points) {
  struct Unit {
    const char* name;
    double factor;
  };
  for (const auto& [unit, factor] :
       {Unit{"", 1}, Unit{"cm", 10}, Unit{"m", 1000}, Unit{"mm, and the model in cm", 0.1}})
    for (const bool flipped : {false, true}) {
      if (factor == 1 && !flipped) continue;
      const auto read = [&](const PlacedPoint& point) -> Vector3d {
        return factor * Vector3d(flipped ? -point.in_model.x() : point.in_model.x(),
                                 flipped ? -point.in_model.y() : point.in_model.y(), point.in_model.z());
      };
      if (std::ranges::all_of(
              points, [&](const PlacedPoint& point) { return box.distance_mm(read(point)) <= box.near_mm; }))
        return fmt::format("{}{}{}", flipped ? "RAS" : "", flipped && *unit ? " and " : "", unit);
    }
  return "";
}

}  // namespace

double ModelBox::largest_side_mm() const {
  return (model_from_box.linear() * (high - low).asDiagonal()).colwise().norm().maxCoeff();
}

double ModelBox::distance_mm(const Vector3d& in_model) const {
  const Vector3d at = model_from_box.inverse() * in_model;
  return (model_from_box.linear() * (at - at.cwiseMax(low).cwiseMin(high))).norm();
}

ModelBox box_of(const registration::Model& model) {
  // Beside the outermost voxels, which are empty.
  return {model.density.model_from_voxel, Vector3d::Constant(0.5),
          model.density.size.cast<double>() - Vector3d::Constant(1.5)};
}

ModelBox box_of(const std::vector<registration::Landmark>& landmarks) {
  ModelBox box;
  box.low = box.high = landmarks.front().in_model;
  for (const registration::Landmark& landmark : landmarks)
    box.low = box.low.cwiseMin(landmark.in_model), box.high = box.high.cwiseMax(landmark.in_model);
  box.near_mm = box.largest_side_mm();
  box.refuses = false;
  box.what = "the box of its landmarks";
  return box;
}

std::vector<Warning> check_places(const std::string& model, const std::string& origin, const ModelBox& box,
                                  const std::vector<PlacedPoint>& points) {
  if (points.empty()) return {};
  const auto farthest = std::ranges::max_element(
      points, {}, [&](const PlacedPoint& point) { return box.distance_mm(point.in_model); });
  const double distance = box.distance_mm(farthest->in_model), side = box.largest_side_mm();
  if (distance <= box.near_mm) return {};
  const auto outside = std::ranges::count_if(
      points, [&](const PlacedPoint& point) { return box.distance_mm(point.in_model) > box.near_mm; });
  const std::string reading = other_reading(box, points);
  const bool refused = box.refuses && distance > side;
  const std::string message = fmt::format(
      "{}: {}: {} of {} points lie outside {}, \"{}\" ({:.1f}, {:.1f}, {:.1f}) by {:.1f} mm (limit {:.3g} "
      "mm, of "
      "the box's largest side){}",
      model, origin, outside, points.size(), box.what, farthest->name, farthest->in_model.x(),
      farthest->in_model.y(), farthest->in_model.z(), distance, side,
      reading.empty() ? ": is it in the model's frame (LPS, mm)?"
                      : fmt::format(": is it in {}? So read, all lie inside", reading));
  const std::map<std::string, double> figures = {
      {"distance_mm", distance}, {"limit_mm", side}, {"points", double(outside)}};
  if (refused) throw BadInput(Failure{Reason::bad_value, message, {}, figures});
  return {{Reason::outside_model, message, {}, figures}};
}

}  // namespace helicarm::case_registration
