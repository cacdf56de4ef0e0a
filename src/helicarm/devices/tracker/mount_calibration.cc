// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/mount_calibration.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/absolute_pose.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/least_squares.h"
#include "helicarm/geometry/pose_step.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Places = std::map<std::string, MountPlace>;
using Observations = std::vector<MountObservation>;

constexpr std::size_t least_places = 3;
/// Rms extent across the line that fits the places best: with less the rotation about it is not determined.
constexpr double least_extent_mm = 5;
/// Standard deviation per axis of a tip whose error is not known: it hardly constrains what the touches show.
constexpr double unknown_tip_mm = 10;
constexpr const char* tip_advice =
    "; the pointer's tip has no covariance: measure it by `helicarm tracker pivot --json`, or state "
    "--tip-sigma";

struct Mount {
  geometry::RigidTransform calibrator_from_facet;
  Vector3d tip_shift = Vector3d::Zero();
};

constexpr int parameters = 9;
using Step = Eigen::Matrix<double, parameters, 1>;
/// Residual (observed less predicted: the place less the touched point), its derivative and weight.
struct Equation {
  Vector3d residual;
  Eigen::Matrix<double, 3, parameters> jacobian;
  Matrix3d weight;
};

Equation equation_of(const Mount& mount, const MountPlace& place, const MountObservation& observed) {
  const Matrix3d& turn = mount.calibrator_from_facet.rotation;
  const Vector3d lever = turn * (observed.point_in_facet + observed.by_tip * mount.tip_shift);
  const Matrix3d covariance = turn * observed.covariance * turn.transpose() + place.covariance;
  Equation equation;
  equation.residual = place.centre_in_calibrator - lever - mount.calibrator_from_facet.translation;
  equation.jacobian << Matrix3d::Identity(), -geometry::cross_matrix(lever), turn * observed.by_tip;
  equation.weight = covariance.inverse();
  if (place.radius_mm == 0) return equation;
  // A touched surface determines the distance from the centre only.
  const Vector3d outward = -equation.residual.normalized();
  equation.residual = (place.radius_mm - equation.residual.norm()) * outward;
  equation.weight = outward * outward.transpose() / outward.dot(covariance * outward);
  return equation;
}

/// Mean of the centres below each label's touches.
std::map<std::string, Vector3d> touched_centres(const Places& places, const Observations& observations) {
  std::map<std::string, std::pair<Vector3d, int>> sums;
  for (const MountObservation& one : observations) {
    auto& [sum, count] = sums.try_emplace(one.label, Vector3d::Zero(), 0).first->second;
    sum += one.point_in_facet - places.at(one.label).radius_mm * one.side;
    ++count;
  }
  std::map<std::string, Vector3d> means;
  for (const auto& [label, sum] : sums) means[label] = sum.first / sum.second;
  return means;
}

/// Rigid motion of the touched centres to the places.
geometry::RigidTransform first_guess(const Places& places, const Observations& observations) {
  std::vector<Vector3d> touched, centres;
  for (const auto& [label, mean] : touched_centres(places, observations)) {
    touched.push_back(mean);
    centres.push_back(places.at(label).centre_in_calibrator);
  }
  return geometry::absolute_pose(touched, centres);
}

struct Fit {
  Mount mount;
  Eigen::Matrix<double, parameters, parameters> information;
  double chi2 = 0;
};

/// The first guess, turned about the places and shifted: touches on all sides of balls have false minima.
std::vector<geometry::RigidTransform> starts(const Places& places, const Observations& observations) {
  constexpr double turns_rad[] = {-0.8, -0.3, 0.3, 0.8};
  const geometry::RigidTransform guess = first_guess(places, observations);
  Vector3d middle = Vector3d::Zero();
  double radius_mm = 0;
  for (const MountObservation& one : observations) {
    const MountPlace& place = places.at(one.label);
    middle += place.centre_in_calibrator / static_cast<double>(observations.size());
    radius_mm = std::max(radius_mm, place.radius_mm);
  }
  std::vector<geometry::RigidTransform> starts;
  if (radius_mm == 0) return starts;  // of divots there is one minimum
  for (int axis = 0; axis < 3; ++axis) {
    for (const double turn : turns_rad) {
      const Matrix3d turned = Eigen::AngleAxisd(turn, Vector3d::Unit(axis)).toRotationMatrix();
      starts.push_back({turned * guess.rotation, turned * (guess.translation - middle) + middle});
    }
    for (const double shift : {-2.0, 2.0})
      starts.push_back({guess.rotation, guess.translation + shift * radius_mm * Vector3d::Unit(axis)});
  }
  return starts;
}

Fit fit_from(const geometry::RigidTransform& start, const Places& places, const Observations& observations,
             const MountOptions& options) {
  // An exact tip has the weight of a nanometre.
  const Matrix3d tip_covariance =
      options.tip_covariance.value_or(Matrix3d(unknown_tip_mm * unknown_tip_mm * Matrix3d::Identity()));
  const Matrix3d tip_weight =
      geometry::solve_spd(tip_covariance + 1e-12 * Matrix3d::Identity(), Matrix3d::Identity()).solution;
  const auto linearise = [&](const Mount& mount) {
    geometry::NormalEquations<parameters> equations{Eigen::Matrix<double, parameters, parameters>::Zero(),
                                                    Step::Zero()};
    equations.information.bottomRightCorner<3, 3>() = tip_weight;
    equations.gradient.tail<3>() = -tip_weight * mount.tip_shift;
    equations.chi2 = mount.tip_shift.dot(tip_weight * mount.tip_shift);
    for (const MountObservation& observed : observations) {
      const auto [residual, jacobian, weight] = equation_of(mount, places.at(observed.label), observed);
      equations.information += jacobian.transpose() * weight * jacobian;
      equations.gradient += jacobian.transpose() * weight * residual;
      equations.chi2 += residual.dot(weight * residual);
    }
    return std::optional(equations);
  };
  const auto moved = [](const Mount& mount, const Step& step) {
    return Mount{geometry::moved(mount.calibrator_from_facet, step.head<6>()),
                 mount.tip_shift + step.tail<3>()};
  };
  const auto found = geometry::fit_least_squares(Mount{start}, linearise, moved);
  return {found->state, found->equations.information, found->equations.chi2};
}

/// From the first guess: enough for what is only compared with a limit.
Fit fit(const Places& places, const Observations& observations, const MountOptions& options) {
  return fit_from(first_guess(places, observations), places, observations, options);
}

/// The pointer's direction tells the side of a ball that was touched, and with it the first guess; another
/// minimum counts only where it explains the touches far better.
Fit best_fit(const Places& places, const Observations& observations, const MountOptions& options) {
  constexpr double clearly_better_chi2 = 10;
  const Fit guessed = fit(places, observations, options);
  Fit best = guessed;
  for (const geometry::RigidTransform& start : starts(places, observations))
    if (Fit one = fit_from(start, places, observations, options); one.chi2 < best.chi2) best = std::move(one);
  return best.chi2 + clearly_better_chi2 < guessed.chi2 ? best : guessed;
}

int equations_of(const Places& places, const Observations& observations) {
  int rows = 0;
  for (const MountObservation& one : observations) rows += places.at(one.label).radius_mm == 0 ? 3 : 1;
  return rows;
}

bool is_tip_unknown(const Observations& observations, const MountOptions& options) {
  return !options.tip_covariance &&
         std::ranges::any_of(observations, [](const MountObservation& one) { return !one.by_tip.isZero(); });
}

int unknowns_of(const Observations& observations, const MountOptions& options) {
  return is_tip_unknown(observations, options) ? 9 : 6;
}

void check_layout(const Places& places, const Observations& observations, const MountOptions& options) {
  std::set<std::string> labels;
  for (const MountObservation& one : observations) {
    if (!places.contains(one.label))
      throw BadInput(Reason::bad_value, fmt::format("the calibrator has no place \"{}\"", one.label));
    labels.insert(one.label);
  }
  const int rows = equations_of(places, observations);
  Vector3d mean = Vector3d::Zero();
  for (const std::string& label : labels)
    mean += places.at(label).centre_in_calibrator / static_cast<double>(labels.size());
  Matrix3d spread = Matrix3d::Zero();
  for (const std::string& label : labels) {
    const Vector3d off = places.at(label).centre_in_calibrator - mean;
    spread += off * off.transpose() / static_cast<double>(labels.size());
  }
  const double extent_mm =
      labels.empty() ? 0 : std::sqrt(std::max(0.0, geometry::symmetric_eigen(spread).values[1]));
  const int unknowns = unknowns_of(observations, options);
  if (labels.size() < least_places || rows <= unknowns || extent_mm < least_extent_mm)
    throw BadInput(
        {Reason::poses_too_alike,
         fmt::format("{} places with {} equations extend {:.3g} mm rms across their line; at least "
                     "{} places, {} equations (a divot gives three, a touch of a ball one) and {:g} "
                     "mm are required: touch further places{}",
                     labels.size(), rows, extent_mm, least_places, unknowns + 1, least_extent_mm,
                     is_tip_unknown(observations, options) ? tip_advice : ""),
         {},
         {{"places", static_cast<double>(labels.size())},
          {"equations", static_cast<double>(rows)},
          {"extent_mm", extent_mm}}});
}

Observations exchanged(Observations observations, const std::string& a, const std::string& b) {
  for (MountObservation& one : observations) {
    if (one.label == a)
      one.label = b;
    else if (one.label == b)
      one.label = a;
  }
  return observations;
}

Observations without(Observations observations, const std::string& label) {
  std::erase_if(observations, [&](const MountObservation& one) { return one.label == label; });
  return observations;
}

bool is_consistent(double chi2, const Places& places, const Observations& observations,
                   const MountOptions& options) {
  const int dof = equations_of(places, observations) - unknowns_of(observations, options);
  return dof > 0 && chi2 <= chi2_quantile(dof, normal_at_999);
}

/// Pairs of places whose exchange leaves consistent residuals.
std::vector<std::pair<std::string, std::string>> consistent_exchanges(const Places& places,
                                                                      const Observations& observations,
                                                                      const MountOptions& options) {
  std::vector<std::pair<std::string, std::string>> pairs;
  const auto means = touched_centres(places, observations);
  for (auto a = means.begin(); a != means.end(); ++a)
    for (auto b = std::next(a); b != means.end(); ++b) {
      const Observations other = exchanged(observations, a->first, b->first);
      if (is_consistent(fit(places, other, options).chi2, places, other, options))
        pairs.emplace_back(a->first, b->first);
    }
  return pairs;
}

/// The only place without which the others are consistent, and its distance from where they put it.
std::optional<std::pair<std::string, double>> displaced(const Places& places,
                                                        const Observations& observations,
                                                        const MountOptions& options) {
  std::optional<std::pair<std::string, double>> found;
  for (const auto& [label, mean] : touched_centres(places, observations)) {
    const Observations rest = without(observations, label);
    if (touched_centres(places, rest).size() < least_places || !is_consistent(0, places, rest, options))
      continue;
    const Fit fitted = fit(places, rest, options);
    if (!is_consistent(fitted.chi2, places, rest, options)) continue;
    if (found) return std::nullopt;
    found = {label,
             (fitted.mount.calibrator_from_facet * mean - places.at(label).centre_in_calibrator).norm()};
  }
  return found;
}

std::string likely_cause(const Places& places, const Observations& observations,
                         const MountOptions& options) {
  if (const auto pairs = consistent_exchanges(places, observations, options); pairs.size() == 1)
    return fmt::format("\"{}\" and \"{}\" were exchanged", pairs[0].first, pairs[0].second);
  if (const auto off = displaced(places, observations, options))
    return fmt::format("\"{}\" was touched {:.2f} mm from where the others place it: touch it again",
                       off->first, off->second);
  Observations mirror = observations;
  for (MountObservation& one : mirror) {
    one.point_in_facet.z() *= -1;
    one.side.z() *= -1;
  }
  if (is_consistent(fit(places, mirror, options).chi2, places, mirror, options))
    return "the places fit a mirror image: the calibrator's file has the wrong handedness";
  return "the calibrator's file, the labels or the pointer's tip do not belong to these touches";
}

}  // namespace

MountObservation touched_place(const std::string& label, const geometry::RigidTransform& tracker_from_facet,
                               const geometry::RigidTransform& tracker_from_pointer,
                               const Vector3d& tip_in_pointer, const MountOptions& options) {
  const geometry::RigidTransform facet_from_pointer = tracker_from_facet.inverse() * tracker_from_pointer;
  const double turn = options.sigma_deg * std::numbers::pi / 180;
  const Matrix3d lever = turn * geometry::cross_matrix(facet_from_pointer.rotation * tip_in_pointer);
  const double shift = options.sigma_mm * options.sigma_mm + options.seat_mm * options.seat_mm;
  return {label, facet_from_pointer * tip_in_pointer,
          shift * Matrix3d::Identity() + lever * lever.transpose(), facet_from_pointer.rotation,
          facet_from_pointer.rotation * -tip_in_pointer.normalized()};
}

MountObservation pivoted_place(const std::string& label, const PivotCalibration& facet) {
  return {label, facet.tip_in_tool, facet.covariance.topLeftCorner<3, 3>()};
}

Expected<MountCalibration> calibrate_mount(const Places& places, std::span<const MountObservation> all,
                                           const MountOptions& options) {
  return guarded([&] {
    const Observations observations(all.begin(), all.end());
    check_layout(places, observations, options);
    const Fit fitted = best_fit(places, observations, options);
    MountCalibration mount{fitted.mount.calibrator_from_facet,
                           {},
                           0,
                           fitted.chi2,
                           equations_of(places, observations) - unknowns_of(observations, options),
                           fitted.mount.tip_shift,
                           {},
                           {},
                           {}};
    double squares = 0;
    for (const MountObservation& observed : observations) {
      const double off = equation_of(fitted.mount, places.at(observed.label), observed).residual.norm();
      mount.residuals.push_back({observed.label, off});
      squares += off * off / static_cast<double>(observations.size());
    }
    mount.fre_mm = std::sqrt(squares);
    if (!is_consistent(fitted.chi2, places, observations, options))
      throw BadInput(
          {Reason::residual_too_large,
           fmt::format("the touched places deviate from the calibrator by {:.2f} mm rms (chi2 {:.4g}, "
                       "limit {:.4g}): {}",
                       mount.fre_mm, mount.chi2, chi2_quantile(mount.dof, normal_at_999),
                       likely_cause(places, observations, options)),
           {},
           {{"fre_mm", mount.fre_mm}, {"chi2", mount.chi2}}});
    mount.exchangeable = consistent_exchanges(places, observations, options);
    const double turn = options.sigma_deg * std::numbers::pi / 180;
    PoseCovariance reading = PoseCovariance::Zero();
    reading.diagonal().head<3>().setConstant(options.sigma_mm * options.sigma_mm);
    reading.diagonal().tail<3>().setConstant(turn * turn);
    mount.covariance =
        std::max(1.0, mount.chi2 / mount.dof) * geometry::inverse(fitted.information).topLeftCorner<6, 6>() +
        reading;
    for (const auto& [label, place] : places) {
      Eigen::Matrix<double, 3, 6> effect;
      effect << Matrix3d::Identity(),
          -geometry::cross_matrix(place.centre_in_calibrator - mount.calibrator_from_facet.translation);
      mount.tre_mm[label] = std::sqrt((effect * mount.covariance * effect.transpose()).trace());
    }
    const auto worst =
        std::ranges::max_element(mount.tre_mm, {}, &std::pair<const std::string, double>::second);
    if (!(worst->second <= options.max_tre_mm))
      throw BadInput(
          {Reason::uncertain,
           fmt::format("predicted error {:.2f} mm at \"{}\", limit {:g} mm: touch more places, farther "
                       "apart{}",
                       worst->second, worst->first, options.max_tre_mm,
                       is_tip_unknown(observations, options) ? tip_advice : ""),
           {},
           {{"tre_mm", worst->second}, {"limit_mm", options.max_tre_mm}}});
    return mount;
  });
}

}  // namespace helicarm::tracker
