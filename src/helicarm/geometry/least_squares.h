// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::geometry {

/// A least-squares problem linearised at one state, with residual r = observed - predicted, Jacobian J =
/// d predicted / d step and weight W, the inverse covariance of the observations.
template <int n>
struct NormalEquations {
  Eigen::Matrix<double, n, n> information;  ///< J^T W J
  Eigen::Matrix<double, n, 1> gradient;     ///< J^T W r
  double chi2 = 0;                          ///< r^T W r
};

struct LeastSquaresOptions {
  int max_iterations = 50;
  double initial_damping = 1e-3;
  double min_gain = 1e-8;  ///< converged where a step is predicted to lower chi2 by less, over 1 + chi2
};

template <class State, int n>
struct LeastSquaresFit {
  State state;
  NormalEquations<n> equations;  ///< at `state`
  bool converged = false;
};

template <int n>
Eigen::Matrix<double, n, 1> step_of(const Eigen::Matrix<double, n, n>& information,
                                    const Eigen::Matrix<double, n, 1>& gradient) {
  if constexpr (n == Eigen::Dynamic)
    return solve_spd(information, gradient).solution;
  else
    return information.ldlt().solve(gradient);
}

/// Levenberg-Marquardt (Marquardt 1963: the diagonal is scaled), ended by an undamped step.
/// `linearise`: State& -> optional<NormalEquations<n>>, nothing where the state is not allowed, which rejects
/// the step; it may store what it computes in the state. `moved`: (const State&, step) -> State. Nothing
/// where the start is not allowed.
template <int n, class State, class Linearise, class Moved>
std::optional<LeastSquaresFit<State, n>> fit_least_squares(State start, const Linearise& linearise,
                                                           const Moved& moved,
                                                           const LeastSquaresOptions& options = {}) {
  using Step = Eigen::Matrix<double, n, 1>;
  constexpr double min_damping = 1e-12;
  constexpr double max_damping = 1e12;
  std::optional<NormalEquations<n>> equations = linearise(start);
  if (!equations) return std::nullopt;
  LeastSquaresFit<State, n> fit{std::move(start), *std::move(equations)};
  double damping = options.initial_damping;
  for (int i = 0; i < options.max_iterations && !fit.converged && damping < max_damping; ++i) {
    const Step newton = step_of<n>(fit.equations.information, fit.equations.gradient);
    fit.converged = newton.allFinite() &&
                    fit.equations.gradient.dot(newton) <= options.min_gain * (1 + fit.equations.chi2);
    for (bool lower = false; !lower && damping < max_damping;) {
      auto damped = fit.equations.information;
      damped.diagonal() *= 1 + damping;
      State next = moved(std::as_const(fit.state),
                         fit.converged ? newton : step_of<n>(damped, fit.equations.gradient));
      std::optional<NormalEquations<n>> there = linearise(next);
      lower = there && there->chi2 < fit.equations.chi2;
      if (lower) {
        fit.state = std::move(next);
        fit.equations = *std::move(there);
      }
      if (fit.converged) break;
      damping = lower ? std::max(min_damping, damping / 8) : damping * 5;
    }
  }
  return fit;
}

}  // namespace helicarm::geometry
