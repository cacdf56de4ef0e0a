// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <optional>
#include <type_traits>
#include <utility>

#include <Eigen/Core>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::geometry {

/// A least-squares problem linearised at one state, with residual r = observed - predicted, Jacobian J =
/// d predicted / d step and weight W, the inverse covariance of the observations.
template <int n>
struct NormalEquations {
  using Step = Eigen::Matrix<double, n, 1>;

  Eigen::Matrix<double, n, n> information;  ///< J^T W J
  Step gradient;                            ///< J^T W r
  double chi2 = 0;                          ///< r^T W r

  /// `damping` is added to the diagonal, relative to it.
  Step step(double damping) const {
    auto damped = information;
    damped.diagonal() *= 1 + damping;
    return solve_spd(damped, gradient).solution;
  }
  /// Decrease of chi2 that the undamped step predicts.
  double decrease(const Step& step) const { return gradient.dot(step); }
};

struct LeastSquaresOptions {
  int max_iterations = 50;
  double initial_damping = 1e-3;
  double min_gain = 1e-8;  ///< converged where a step is predicted to lower chi2 by less, over 1 + chi2
};

template <class State, class Equations>
struct LeastSquaresFit {
  State state;
  Equations equations;  ///< at `state`
  bool converged = false;
};

/// Levenberg-Marquardt (Marquardt 1963: the diagonal is scaled), ended by an undamped step.
/// `linearise`: State& -> optional<Equations>, `NormalEquations` or `ArrowEquations`, nothing where the state
/// is not allowed, which rejects the step; it may store what it computes in the state. `moved`: (const
/// State&, step) -> State. Nothing where the start is not allowed.
template <class State, class Linearise, class Moved>
auto fit_least_squares(State start, const Linearise& linearise, const Moved& moved,
                       const LeastSquaresOptions& options = {}) {
  using Equations = typename std::invoke_result_t<Linearise, State&>::value_type;
  using Fit = LeastSquaresFit<State, Equations>;
  constexpr double min_damping = 1e-12;
  constexpr double max_damping = 1e12;
  std::optional<Equations> equations = linearise(start);
  if (!equations) return std::optional<Fit>();
  Fit fit{std::move(start), *std::move(equations)};
  double damping = options.initial_damping;
  for (int i = 0; i < options.max_iterations && !fit.converged && damping < max_damping; ++i) {
    const auto newton = fit.equations.step(0);
    fit.converged =
        newton.allFinite() && fit.equations.decrease(newton) <= options.min_gain * (1 + fit.equations.chi2);
    for (bool lower = false; !lower && damping < max_damping;) {
      State next = moved(std::as_const(fit.state), fit.converged ? newton : fit.equations.step(damping));
      std::optional<Equations> there = linearise(next);
      lower = there && there->chi2 < fit.equations.chi2;
      if (lower) {
        fit.state = std::move(next);
        fit.equations = *std::move(there);
      }
      if (fit.converged) break;
      damping = lower ? std::max(min_damping, damping / 8) : damping * 5;
    }
  }
  return std::optional(std::move(fit));
}

}  // namespace helicarm::geometry
