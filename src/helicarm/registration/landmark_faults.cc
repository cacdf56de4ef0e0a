// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/landmark_faults.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/absolute_pose.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/small_matrix.h"

namespace helicarm::registration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Per axis; observers repeat anatomical landmarks in a CT within 1 to 2 mm.
constexpr double placing_mm = 2;
constexpr double repeated_placing_mm = 1;  // of landmarks whose residuals say no worse
constexpr double least_sigma_mm = 0.1;
constexpr double better = 3;  // FRE of the given names over that of others
constexpr std::size_t most_permuted = 6;
constexpr double warned_ratio = 2, refused_ratio_of_landmarks = 4;

using Order = std::vector<std::size_t>;

double fre_of(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to) {
  const auto motion = geometry::absolute_pose(from, to);
  double sum = 0;
  for (std::size_t i = 0; i < from.size(); ++i) sum += (motion * from[i] - to[i]).squaredNorm();
  return std::sqrt(sum / double(from.size()));
}

struct Places {
  std::vector<Vector3d> model, world;

  explicit Places(const std::vector<Landmark>& landmarks) {
    for (const Landmark& landmark : landmarks)
      model.push_back(landmark.in_model), world.push_back(landmark.in_world);
  }
  double fre_in(const Order& order) const {
    std::vector<Vector3d> renamed;
    for (const std::size_t i : order) renamed.push_back(world[i]);
    return fre_of(model, renamed);
  }
  double mirrored_fre() const {
    std::vector<Vector3d> mirrored = model;
    for (Vector3d& point : mirrored) point.x() *= -1;
    return fre_of(mirrored, world);
  }
  double spread(const std::vector<Vector3d>& points) const {
    double sum = 0;
    for (const Vector3d& point : points) sum += (point - geometry::mean_of(points)).squaredNorm();
    return std::sqrt(sum / double(points.size()));
  }
};

/// Every order of a few names; of more the exchanges of two.
std::vector<Order> other_orders(std::size_t n) {
  Order order(n);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::vector<Order> all;
  if (n <= most_permuted) {
    while (std::ranges::next_permutation(order).found) all.push_back(order);
    return all;
  }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < i; ++j) {
      all.push_back(order);
      std::swap(all.back()[i], all.back()[j]);
    }
  return all;
}

/// Whether an order moves names only between places that its own residuals distinguish.
bool is_distinct(const Places& places, const Order& order, double fre) {
  for (std::size_t i = 0; i < order.size(); ++i)
    if (order[i] != i && (places.world[i] - places.world[order[i]]).norm() < better * fre) return false;
  return true;
}

std::string names_in(const std::vector<Landmark>& landmarks, const Order& order) {
  std::vector<std::string> moved;
  for (std::size_t i = 0; i < order.size(); ++i)
    if (order[i] != i) moved.push_back(fmt::format("\"{}\"", landmarks[i].name));
  if (moved.size() == 2) return fmt::format("{} and {} exchanged", moved[0], moved[1]);
  std::string pairs;
  for (std::size_t i = 0; i < order.size(); ++i)
    if (order[i] != i)
      pairs += fmt::format("{}\"{}\" in the place of \"{}\"", pairs.empty() ? "" : ", ", landmarks[i].name,
                           landmarks[order[i]].name);
  return pairs;
}

struct Explanation {
  std::string text;
  double fre_mm;
};

/// What fits `better` times better than the given names.
std::optional<Explanation> explanation(const std::vector<Landmark>& landmarks, double fre_mm) {
  const Places places(landmarks);
  std::optional<Explanation> best;
  const auto take = [&](double fre, const std::string& text) {
    if (fre * better <= fre_mm && (!best || fre < best->fre_mm)) best = Explanation{text, fre};
  };
  for (const Order& order : other_orders(landmarks.size()))
    if (const double fre = places.fre_in(order);
        fre * better <= fre_mm && (!best || fre < best->fre_mm) && is_distinct(places, order, fre))
      take(fre, names_in(landmarks, order) + ": correct the names in the landmarks' file or of the picks");
  if (landmarks.size() > least_landmarks)
    take(places.mirrored_fre(),
         "the mirror image of the landmarks: their file or the cameras have the wrong handedness");
  const double ratio = places.spread(places.world) / places.spread(places.model);
  constexpr std::array<std::pair<double, const char*>, 4> units = {
      {{10, "cm"}, {1000, "m"}, {0.1, "tenths of a mm"}, {0.001, "micrometres"}}};
  for (const auto& [factor, unit] : units) {
    if (std::abs(ratio / factor - 1) > 0.1) continue;
    Places scaled = places;
    for (Vector3d& point : scaled.model) point *= factor;
    take(fre_of(scaled.model, scaled.world),
         fmt::format("the landmarks' file in {}: it must be in mm", unit));
  }
  return best;
}

double chi2_of(const std::vector<Landmark>& landmarks, const LandmarkRegistration& found, double sigma_mm) {
  double sum = 0;
  for (std::size_t i = 0; i < landmarks.size(); ++i)
    sum += std::pow(found.residuals_mm[i], 2) /
           (landmarks[i].covariance_in_world.trace() / 3 + sigma_mm * sigma_mm);
  return sum;
}

/// The middle, and the normal of the plane that fits the landmarks of the model best.
std::pair<Vector3d, Vector3d> plane_of(const std::vector<Vector3d>& points) {
  const Vector3d middle = geometry::mean_of(points);
  Matrix3d spread = Matrix3d::Zero();
  for (const Vector3d& point : points) spread += (point - middle) * (point - middle).transpose();
  return {middle, geometry::symmetric_eigen(spread).vectors.col(0)};
}

}  // namespace

std::optional<LandmarkFault> landmark_fault(const std::vector<Landmark>& landmarks,
                                            const LandmarkRegistration& found) {
  const double dof = 3 * double(landmarks.size()) - 6;
  const double limit = chi2_quantile(dof, normal_at_999);
  if (chi2_of(landmarks, found, least_sigma_mm) <= limit) return std::nullopt;
  const auto largest = std::ranges::max_element(found.residuals_mm) - found.residuals_mm.begin();
  const std::string& name = landmarks[std::size_t(largest)].name;
  std::string message = fmt::format(
      "the landmarks deviate from their picks by {:.2f} mm rms (FRE), most \"{}\" "
      "by {:.2f} mm",
      found.fre_mm, name, found.residuals_mm[std::size_t(largest)]);
  std::map<std::string, double> figures = {{"fre_mm", found.fre_mm},
                                           {"largest_mm", found.residuals_mm[std::size_t(largest)]}};
  if (const auto cause = explanation(landmarks, found.fre_mm)) {
    figures["explained_fre_mm"] = cause->fre_mm;
    return LandmarkFault{{Reason::residual_too_large,
                          message + fmt::format("; by {:.2f} mm with {}", cause->fre_mm, cause->text),
                          {},
                          figures},
                         true};
  }
  const double chi2 = chi2_of(landmarks, found, placing_mm);
  if (chi2 <= limit) return std::nullopt;
  figures["chi2"] = chi2, figures["limit"] = limit;
  return LandmarkFault{
      {Reason::residual_too_large,
       message + fmt::format(", more than the picks' errors and {:g} mm per axis of placing "
                             "allow (chi-square {:.0f}, limit {:.0f}): check its picks and its "
                             "place in the landmarks' file",
                             placing_mm, chi2, limit),
       {},
       figures},
      false};
}

std::optional<LandmarkFault> contradiction(const std::vector<Landmark>& landmarks,
                                           const LandmarkRegistration& found,
                                           const geometry::RigidTransform& world_from_model,
                                           const RigidCovariance& covariance, const Vector3d& centre) {
  if (!covariance.allFinite()) return std::nullopt;
  const double n = double(landmarks.size());
  const double placing = std::max(found.fle_mm, std::sqrt(3.0) * repeated_placing_mm);
  double apart = 0, expected = 0, farthest = 0;
  std::string name;
  for (const Landmark& landmark : landmarks) {
    const Vector3d at = world_from_model * landmark.in_model;
    const double distance = (at - landmark.in_world).norm();
    apart += distance * distance / n;
    expected += (std::max(landmark.covariance_in_world.trace(), placing * placing) +
                 point_covariance(covariance, centre, at).trace()) /
                n;
    if (distance >= farthest) farthest = distance, name = landmark.name;
  }
  apart = std::sqrt(apart), expected = std::sqrt(expected);
  if (apart <= warned_ratio * expected) return std::nullopt;
  return LandmarkFault{
      {Reason::registration_disagrees,
       fmt::format(
           "the landmarks lie {:.2f} mm rms from the pose that the images gave, most \"{}\" by {:.2f} mm; "
           "{:.2f} mm are expected and they fit each other within {:.2f} mm (FRE): look at the overlay, "
           "and check their picks and file",
           apart, name, farthest, expected, found.fre_mm),
       {},
       {{"distance_mm", apart},
        {"expected_mm", expected},
        {"largest_mm", farthest},
        {"limit_mm", warned_ratio * expected}}},
      apart > refused_ratio_of_landmarks * expected};
}

std::optional<Warning> handedness_note(const std::vector<Landmark>& landmarks,
                                       const LandmarkRegistration& found,
                                       const std::vector<Vector3d>& carried) {
  const Places places(landmarks);
  const double mirrored = places.mirrored_fre();
  if (landmarks.size() > least_landmarks && mirrored > better * std::max(found.fre_mm, found.fle_mm))
    return std::nullopt;
  const auto [middle, normal] = plane_of(places.model);
  double moved = 0;
  for (const Vector3d& point : carried) moved = std::max(moved, 2 * std::abs(normal.dot(point - middle)));
  std::map<std::string, double> figures = {{"fre_mm", found.fre_mm}, {"mirrored_fre_mm", mirrored}};
  std::string text = fmt::format(
      "{} landmarks {}: a file of the wrong handedness fits as well (FRE {:.2f} mm, "
      "{:.2f} mm as mirror image)",
      landmarks.size(), landmarks.size() == least_landmarks ? "have no handedness" : "lie near a plane",
      found.fre_mm, mirrored);
  if (!carried.empty()) {
    text += fmt::format(" and would put a planned point up to {:.1f} mm elsewhere", moved);
    figures["moved_mm"] = moved;
  }
  return Warning{
      Reason::ambiguous_handedness, text + "; pick a fourth landmark away from their plane", {}, figures};
}

}  // namespace helicarm::registration
