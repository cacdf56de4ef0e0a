// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/smooth.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::track {
namespace {

using geometry::RigidTransform;
constexpr int enough_updates = 10;  // for the noise by the data
constexpr int state_size = 18;      // errors: rotation, centre, their rates, their second derivatives
using StateVector = Eigen::Matrix<double, state_size, 1>;
using StateMatrix = Eigen::Matrix<double, state_size, state_size>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

struct State {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 12, 1> rates = Eigen::Matrix<double, 12, 1>::Zero();  // turn, shift; twice
};

State moved(const State& state, const StateVector& step) {
  return {geometry::rotation_from_vector(step.head<3>()) * state.rotation, state.centre + step.segment<3>(3),
          state.rates + step.tail<12>()};
}

StateVector between(const State& from, const State& to) {
  StateVector step;
  step.head<3>() = geometry::vector_from_rotation(to.rotation * from.rotation.transpose());
  step.segment<3>(3) = to.centre - from.centre;
  step.tail<12>() = to.rates - from.rates;
  return step;
}

Eigen::Vector3d turn_over(const State& state, double dt) {
  return dt * state.rates.head<3>() + dt * dt / 2 * state.rates.segment<3>(6);
}

State predicted(const State& state, double dt) {
  State next = state;
  next.rotation = geometry::rotation_from_vector(turn_over(state, dt)) * state.rotation;
  next.centre += dt * state.rates.segment<3>(3) + dt * dt / 2 * state.rates.segment<3>(9);
  next.rates.head<6>() += dt * state.rates.tail<6>();
  return next;
}

StateMatrix transition(const State& state, double dt) {
  StateMatrix f = StateMatrix::Identity();
  f.block<6, 6>(0, 6).diagonal().setConstant(dt);
  f.block<6, 6>(0, 12).diagonal().setConstant(dt * dt / 2);
  f.block<6, 6>(6, 12).diagonal().setConstant(dt);
  f.topLeftCorner<3, 3>() = geometry::rotation_from_vector(turn_over(state, dt));
  return f;
}

/// Of white jerk.
StateMatrix process(const MotionPrior& prior, double dt) {
  const double powers[3][3] = {{std::pow(dt, 5) / 20, std::pow(dt, 4) / 8, std::pow(dt, 3) / 6},
                               {std::pow(dt, 4) / 8, std::pow(dt, 3) / 3, dt * dt / 2},
                               {std::pow(dt, 3) / 6, dt * dt / 2, dt}};
  StateMatrix q = StateMatrix::Zero();
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k)
      for (int axis = 0; axis < 6; ++axis)
        q(6 * i + axis, 6 * k + axis) = powers[i][k] * (axis < 3 ? prior.turn : prior.shift);
  return q;
}

struct Step {
  State predicted, filtered;
  StateMatrix predicted_covariance, covariance, transition;
};

struct Filtered {
  std::vector<Step> steps;
  double squares = 0, log_widths = 0;  // of the innovations
  int updates = 0;

  /// Of the measured covariances. The first three frames begin the motion and its rates.
  double variance_factor(NoiseScale scale) const {
    constexpr double least = 1e-3, most = 1e2;
    if (scale == NoiseScale::stated || updates < enough_updates) return 1;
    return std::clamp(squares / (6.0 * (updates - 3)), least, most);
  }
  double log_likelihood(NoiseScale scale) const {
    const double factor = variance_factor(scale);
    return -0.5 * squares / factor - 3.0 * (updates - 3) * std::log(factor) - log_widths;
  }
};

struct Measured {
  State at;
  Matrix6 covariance;
};

Filtered filter(std::span<const double> times, std::span<const std::optional<Measured>> measured,
                const MotionPrior& prior, bool turns, bool keep) {
  constexpr double wide_turn = 0.3, wide_shift = 10;
  Filtered result;
  const auto first = std::ranges::find_if(measured, [](const auto& each) { return each.has_value(); });
  State state = (*first)->at;
  StateMatrix covariance = StateMatrix::Zero();
  // Before the first measured frame the pose is that frame's, with the width of the rates until then.
  const double before = times[std::size_t(first - measured.begin())] - times.front();
  for (int axis = 0; axis < 6; ++axis) {
    const double wide = axis < 3 ? (turns ? wide_turn : 1e-9) : wide_shift;
    covariance(axis, axis) = std::pow(wide * (1 + before), 2);
    covariance(6 + axis, 6 + axis) = covariance(12 + axis, 12 + axis) = wide * wide;
  }
  for (std::size_t i = 0; i < times.size(); ++i) {
    Step step;
    step.transition.setIdentity();
    if (i > 0) {
      const double dt = times[i] - times[i - 1];
      step.transition = transition(state, dt);
      state = predicted(state, dt);
      covariance = step.transition * covariance * step.transition.transpose() + process(prior, dt);
    }
    step.predicted = state;
    step.predicted_covariance = covariance;
    if (measured[i]) {
      const Vector6 off = between(state, measured[i]->at).head<6>();
      const Matrix6 spread = covariance.topLeftCorner<6, 6>() + measured[i]->covariance;
      const Matrix6 weight = geometry::inverse(spread);
      const Eigen::Matrix<double, state_size, 6> gain = covariance.leftCols<6>() * weight;
      result.squares += off.dot(weight * off);
      result.log_widths +=
          0.5 * geometry::log_determinant(spread).value_or(std::numeric_limits<double>::infinity());
      ++result.updates;
      state = moved(state, gain * off);
      covariance -= gain * covariance.topRows<6>();
      covariance = (0.5 * (covariance + covariance.transpose())).eval();
    }
    step.filtered = state;
    step.covariance = covariance;
    if (keep) result.steps.push_back(step);
  }
  return result;
}

/// What is found by the likelihood.
struct Model : MotionPrior {
  double ratio = 1;  ///< of the factors of the places' and the turns' standard deviations
};

std::vector<std::optional<Measured>> scaled(std::span<const std::optional<Measured>> measured,
                                            double shift_factor) {
  Vector6 factors = Vector6::Ones();
  factors.tail<3>().setConstant(shift_factor);
  std::vector<std::optional<Measured>> made(measured.begin(), measured.end());
  for (auto& frame : made)
    if (frame) frame->covariance = factors.asDiagonal() * frame->covariance * factors.asDiagonal();
  return made;
}

/// The model of the largest likelihood, found on a grid of factors that is refined.
Model likeliest(std::span<const double> times, std::span<const std::optional<Measured>> measured, bool turns,
                NoiseScale scale) {
  constexpr double least_factor = 1.3, largest_ratio = 30;
  const bool by_data =
      scale == NoiseScale::by_data && turns &&
      std::ranges::count_if(measured, [](const auto& each) { return each.has_value(); }) >= enough_updates;
  const auto likelihood = [&](const Model& tried) {
    if (tried.ratio == 1) return filter(times, measured, tried, turns, false).log_likelihood(scale);
    return filter(times, scaled(measured, tried.ratio), tried, turns, false).log_likelihood(scale);
  };
  Model best{{turns ? 1e-7 : 1e-12, 1e-2}};
  double most = likelihood(best);
  for (double factor = 10; factor > least_factor; factor = std::sqrt(factor)) {
    bool is_better = true;
    for (int rounds = 0; is_better && rounds < 8; ++rounds) {
      is_better = false;
      std::vector<double*> parts;
      Model tried = best;
      if (turns) parts.push_back(&tried.turn);
      parts.push_back(&tried.shift);
      if (by_data) parts.push_back(&tried.ratio);
      for (double* part : parts) {
        for (const double by : {factor, 1 / factor}) {
          tried = best;
          *part *= part == &tried.ratio ? std::sqrt(by) : by;
          if (std::max(tried.ratio, 1 / tried.ratio) > largest_ratio) continue;
          const double there = likelihood(tried);
          if (!(there > most + 1e-3)) continue;
          most = there;
          best = tried;
          is_better = true;
        }
      }
    }
  }
  return best;
}

struct Smoothed {
  State state;
  Matrix6 covariance;
};

std::vector<Smoothed> smoothed(const Filtered& filtered) {
  const std::size_t count = filtered.steps.size();
  std::vector<Smoothed> result(count);
  State state = filtered.steps.back().filtered;
  StateMatrix covariance = filtered.steps.back().covariance;
  result.back() = {state, covariance.topLeftCorner<6, 6>()};
  for (std::size_t i = count - 1; i-- > 0;) {
    const Step &here = filtered.steps[i], &next = filtered.steps[i + 1];
    const StateMatrix gain = geometry::solve_spd(next.predicted_covariance, next.transition * here.covariance)
                                 .solution.transpose();
    state = moved(here.filtered, gain * between(next.predicted, state));
    covariance = here.covariance + gain * (covariance - next.predicted_covariance) * gain.transpose();
    covariance = (0.5 * (covariance + covariance.transpose())).eval();
    result[i] = {state, covariance.topLeftCorner<6, 6>()};
  }
  return result;
}

/// The shares of the measured covariances that the scatter of the frames does not show: errors that
/// neighbouring frames share, which are not smoothed away. A frame without a pose has those of the measured
/// one before it.
void add_shared(std::vector<FramePose>& frames, std::span<const std::optional<FramePose>> measured,
                double turn_variance, double shift_variance) {
  Vector6 roots;
  roots << Eigen::Vector3d::Constant(std::sqrt(std::max(0.0, 1 - turn_variance))),
      Eigen::Vector3d::Constant(std::sqrt(std::max(0.0, 1 - shift_variance)));
  const FramePose* last =
      &**std::ranges::find_if(measured, [](const auto& each) { return each.has_value(); });
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (measured[i]) last = &*measured[i];
    frames[i].covariance += roots.asDiagonal() * last->covariance * roots.asDiagonal();
    frames[i].common = last->common;
  }
}

bool is_enough(std::span<const std::optional<Measured>> measured) {
  constexpr std::ptrdiff_t least = 3;
  return std::ranges::count_if(measured, [](const auto& each) { return each.has_value(); }) >= least;
}

}  // namespace

std::optional<SmoothMotion> smooth_poses(std::span<const double> times,
                                         std::span<const std::optional<FramePose>> measured,
                                         const Eigen::Vector3d& centre_in_body, NoiseScale scale) {
  std::vector<std::optional<Measured>> states;
  for (const auto& frame : measured) {
    auto& made = states.emplace_back();
    if (!frame) continue;
    State at;
    at.rotation = frame->pose.rotation;
    at.centre = frame->pose * centre_in_body;
    made = Measured{at, frame->covariance};
  }
  if (!is_enough(states)) return std::nullopt;
  SmoothMotion motion;
  const Model model = likeliest(times, states, true, scale);
  motion.prior = model;
  const Filtered filtered = filter(times, scaled(states, model.ratio), model, true, true);
  const double factor = filtered.variance_factor(scale);
  for (const Smoothed& frame : smoothed(filtered))
    motion.frames.push_back(
        {{frame.state.rotation, frame.state.centre - frame.state.rotation * centre_in_body},
         factor * frame.covariance});
  const double shift_factor = factor * model.ratio * model.ratio;
  add_shared(motion.frames, measured, factor, shift_factor);
  motion.prior.turn *= factor;
  motion.prior.shift *= factor;
  motion.turn_noise_factor = std::sqrt(factor);
  motion.noise_factor = std::sqrt(shift_factor);
  return motion;
}

std::optional<std::vector<FramePlace>> smooth_places(std::span<const double> times,
                                                     std::span<const std::optional<FramePlace>> measured) {
  std::vector<std::optional<Measured>> states;
  for (const auto& frame : measured) {
    auto& made = states.emplace_back();
    if (!frame) continue;
    made = Measured{{}, Matrix6::Identity()};
    made->at.centre = frame->place;
    made->covariance.bottomRightCorner<3, 3>() = frame->covariance;
  }
  if (!is_enough(states)) return std::nullopt;
  const MotionPrior prior = likeliest(times, states, false, NoiseScale::stated);
  std::vector<FramePlace> places;
  for (const Smoothed& frame : smoothed(filter(times, states, prior, false, true)))
    places.push_back({frame.state.centre, frame.covariance.bottomRightCorner<3, 3>()});
  return places;
}

}  // namespace helicarm::track
