// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/hand_eye.h"

#include <algorithm>
#include <numbers>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/least_squares.h"
#include "helicarm/geometry/pose_step.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace {

using Matrix12 = Eigen::Matrix<double, 12, 12>;
using Vector12 = Eigen::Matrix<double, 12, 1>;

constexpr double deg_per_rad = 180 / std::numbers::pi;

/// Simulated poses may be exact: far below any tracker, far above rounding.
constexpr double least_sigma_mm = 1e-6;
constexpr double least_sigma_rad = 1e-9;

/// A of the flange, B of the marker: AX = XB.
struct Motion {
  geometry::RigidTransform a;
  geometry::RigidTransform b;
};

/// Each pose relative to the next one and to the one half the list away.
std::vector<Motion> motions_of(std::span<const HandEyePair> pairs) {
  std::vector<Motion> motions;
  const std::size_t count = pairs.size();
  for (std::size_t i = 0; i < count; ++i)
    for (const std::size_t j : {(i + 1) % count, (i + (count + 1) / 2) % count})
      motions.push_back({pairs[i].base_from_flange.inverse() * pairs[j].base_from_flange,
                         pairs[i].tracker_from_marker.inverse() * pairs[j].tracker_from_marker});
  return motions;
}

/// Rms rotation about the second principal axis of the rotations, deg: 0 if all axes are parallel.
double second_turn_deg(const std::vector<Motion>& motions) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Motion& motion : motions) {
    const Eigen::Vector3d turn = geometry::vector_from_rotation(motion.a.rotation);
    spread += turn * turn.transpose() / static_cast<double>(motions.size());
  }
  return std::sqrt(geometry::symmetric_eigen(spread).values[1]) * deg_per_rad;
}

geometry::RigidTransform start_of_x(const std::vector<Motion>& motions) {
  // Near 180 degrees the direction of the rotation vector is ambiguous.
  constexpr double widest_turn = 170 / deg_per_rad;
  Eigen::Matrix3d together = Eigen::Matrix3d::Zero();
  for (const Motion& motion : motions) {
    const Eigen::Vector3d alpha = geometry::vector_from_rotation(motion.a.rotation);
    const Eigen::Vector3d beta = geometry::vector_from_rotation(motion.b.rotation);
    if (alpha.norm() < widest_turn) together += alpha * beta.transpose();
  }
  geometry::RigidTransform x;
  x.rotation = geometry::nearest_rotation(together);
  const auto rows = static_cast<Eigen::Index>(3 * motions.size());
  Eigen::MatrixXd left(rows, 3);
  Eigen::VectorXd right(rows);
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(3 * i);
    left.middleRows<3>(row) = motions[i].a.rotation - Eigen::Matrix3d::Identity();
    right.segment<3>(row) = x.rotation * motions[i].b.translation - motions[i].a.translation;
  }
  x.translation = geometry::linear_least_squares(left, right).solution;
  return x;
}

geometry::RigidTransform start_of_y(std::span<const HandEyePair> pairs, const geometry::RigidTransform& x) {
  geometry::RigidTransform sum{Eigen::Matrix3d::Zero(), Eigen::Vector3d::Zero()};
  for (const HandEyePair& pair : pairs) {
    const geometry::RigidTransform one = pair.tracker_from_marker * (pair.base_from_flange * x).inverse();
    sum.rotation += one.rotation;
    sum.translation += one.translation / static_cast<double>(pairs.size());
  }
  return {geometry::nearest_rotation(sum.rotation), sum.translation};
}

geometry::PoseStep residual_of(const HandEyePair& pair, const HandEye& at) {
  return geometry::step_between(at.tracker_from_base * pair.base_from_flange * at.flange_from_marker,
                                pair.tracker_from_marker);
}

/// Derivatives of the predicted marker's position and rotation with respect to position and rotation of X,
/// then Y.
Eigen::Matrix<double, 6, 12> jacobian_of(const HandEyePair& pair, const HandEye& at) {
  const Eigen::Matrix3d tracker_from_flange = at.tracker_from_base.rotation * pair.base_from_flange.rotation;
  const Eigen::Vector3d lever =
      at.tracker_from_base.rotation * (pair.base_from_flange * at.flange_from_marker.translation);
  Eigen::Matrix<double, 6, 12> jacobian = Eigen::Matrix<double, 6, 12>::Zero();
  jacobian.block<3, 3>(0, 0) = tracker_from_flange;
  jacobian.block<3, 3>(3, 3) = tracker_from_flange;
  jacobian.block<3, 3>(0, 6).setIdentity();
  jacobian.block<3, 3>(0, 9) = -geometry::cross_matrix(lever);
  jacobian.block<3, 3>(3, 9).setIdentity();
  return jacobian;
}

Expected<HandEye> refined(std::span<const HandEyePair> pairs, double sigma_mm, double sigma_rad,
                          const HandEye& start) {
  using Equations = geometry::NormalEquations<12>;
  geometry::PoseStep weights;
  weights << Eigen::Vector3d::Constant(1 / (sigma_mm * sigma_mm)),
      Eigen::Vector3d::Constant(1 / (sigma_rad * sigma_rad));
  const auto linearise = [&](const HandEye& state) {
    Equations equations{Matrix12::Zero(), Vector12::Zero()};
    for (const HandEyePair& pair : pairs) {
      const Eigen::Matrix<double, 6, 12> jacobian = jacobian_of(pair, state);
      const Eigen::Matrix<double, 12, 6> weighted = jacobian.transpose() * weights.asDiagonal();
      const geometry::PoseStep residual = residual_of(pair, state);
      equations.information += weighted * jacobian;
      equations.gradient += weighted * residual;
      equations.chi2 += residual.dot(weights.asDiagonal() * residual);
    }
    return std::optional(equations);
  };
  const auto stepped = [](const HandEye& from, const Vector12& step) {
    HandEye to = from;
    to.flange_from_marker = geometry::moved(from.flange_from_marker, step.head<6>());
    to.tracker_from_base = geometry::moved(from.tracker_from_base, step.tail<6>());
    return to;
  };
  auto fit = geometry::fit_least_squares(start, linearise, stepped);
  if (!fit->converged) return fail(Reason::uncertain, "the hand-eye calibration does not converge");
  fit->state.covariance = geometry::inverse(fit->equations.information);
  return fit->state;
}

}  // namespace

Expected<HandEye> calibrate_hand_eye(std::span<const HandEyePair> pairs, const HandEyeOptions& options) {
  constexpr std::size_t min_pairs = 3;
  constexpr int noise_rounds = 3;
  HandEye result;
  const std::vector<Motion> motions = motions_of(pairs);
  if (pairs.size() >= min_pairs) result.turn_deg = second_turn_deg(motions);
  if (result.turn_deg < options.min_turn_deg || pairs.size() < min_pairs)
    return fail(Reason::poses_too_alike,
                fmt::format("{} poses rotate by {:.3g} degrees rms about a second axis, at least {} poses "
                            "and {:g} degrees are required",
                            pairs.size(), result.turn_deg, min_pairs, options.min_turn_deg),
                {{"poses", static_cast<double>(pairs.size())}, {"turn_deg", result.turn_deg}});

  result.flange_from_marker = start_of_x(motions);
  result.tracker_from_base = start_of_y(pairs, result.flange_from_marker);
  const bool known_noise = options.sigma_mm > 0 && options.sigma_deg > 0;
  double sigma_mm = known_noise ? options.sigma_mm : 0.2;  // initial value: typical of trackers
  double sigma_rad = (known_noise ? options.sigma_deg : 0.1) / deg_per_rad;
  const double count = static_cast<double>(pairs.size());
  for (int round = 0; round < (known_noise ? 1 : noise_rounds); ++round) {
    const auto refinement = refined(pairs, sigma_mm, sigma_rad, result);
    if (!refinement) return refinement;
    result = *refinement;
    double square_mm = 0, square_rad = 0;
    for (const HandEyePair& pair : pairs) {
      const geometry::PoseStep residual = residual_of(pair, result);
      square_mm += residual.head<3>().squaredNorm();
      square_rad += residual.tail<3>().squaredNorm();
    }
    result.rms_mm = std::sqrt(square_mm / count);
    result.rms_deg = std::sqrt(square_rad / count) * deg_per_rad;
    // Six of the twelve unknowns are rotations.
    sigma_mm = std::max(std::sqrt(square_mm / (3 * count - 6)), least_sigma_mm);
    sigma_rad = std::max(std::sqrt(square_rad / (3 * count - 6)), least_sigma_rad);
  }
  if (result.rms_mm > options.max_rms_mm || result.rms_deg > options.max_rms_deg)
    return fail(
        Reason::residual_too_large,
        fmt::format(
            "robot and tracker poses differ by {:.3g} mm and {:.3g} degrees rms, limits {:g} mm and {:g} "
            "degrees",
            result.rms_mm, result.rms_deg, options.max_rms_mm, options.max_rms_deg),
        {{"rms_mm", result.rms_mm}, {"rms_deg", result.rms_deg}});
  return result;
}

}  // namespace helicarm::tracker
