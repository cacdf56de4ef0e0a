// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <complex>

#include <Eigen/LU>

#include "helicarm/phantom/plate.h"

namespace helicarm::phantom {
namespace {

/// Dots as complex numbers: a rotation is a factor of modulus 1.
using Dots = Eigen::VectorXcd;

/// Sorted by distance from the dot nearest the middle, which comes first, at the origin.
Dots from_the_middle(const std::vector<Eigen::Vector2d>& dots_mm) {
  Dots dots(dots_mm.size());
  std::transform(dots_mm.begin(), dots_mm.end(), dots.begin(),
                 [](const auto& dot) { return std::complex(dot.x(), dot.y()); });
  const auto nearer = [](const auto& a, const auto& b) { return std::norm(a) < std::norm(b); };
  dots.array() -= dots.mean();
  dots.array() -= *std::min_element(dots.begin(), dots.end(), nearer);
  std::stable_sort(dots.begin(), dots.end(), nearer);
  return dots;
}

Dots nearest_places(const Dots& dots, const Eigen::Matrix2d& steps) {
  const Eigen::Matrix2d inverse = steps.inverse();
  return dots.unaryExpr([&](const std::complex<double>& dot) {
    const Eigen::Vector2d indices = inverse * Eigen::Vector2d(dot.real(), dot.imag());
    const Eigen::Vector2d position = steps * Eigen::Vector2d(indices.array().round());
    return std::complex(position.x(), position.y());
  });
}

/// Largest residual of the lattice grown outwards from the first two dots with the given initial rotation.
double grown_misfit(const Dots& dots, const Eigen::Matrix2d& steps, std::complex<double> turn) {
  std::complex<double> offset = 0;
  for (Eigen::Index count = 2;; count = std::min(2 * count, dots.size())) {
    const Dots near = dots.head(count);
    const Dots places = nearest_places((near.array() - offset) / turn, steps);
    const Dots spread = places.array() - places.mean();
    turn = spread.dot(near);
    turn /= std::abs(turn);
    offset = near.mean() - turn * places.mean();
    if (count == dots.size()) return (near.array() - offset - turn * places.array()).abs().maxCoeff();
  }
}

}  // namespace

Eigen::Matrix2d lattice_steps(Lattice lattice) {
  if (lattice == Lattice::square) return Eigen::Matrix2d::Identity();
  return (Eigen::Matrix2d() << 1, 0.5, 0, std::sqrt(3.0) / 2).finished();
}

std::optional<double> lattice_misfit(const std::vector<Eigen::Vector2d>& dots_mm, Lattice lattice,
                                     double pitch_mm, double limit_mm) {
  if (dots_mm.size() < 2) return 0.0;
  const Dots dots = from_the_middle(dots_mm);
  const Eigen::Matrix2d steps = pitch_mm * lattice_steps(lattice);
  const double step_length = std::abs(dots[1]);
  const int reach = static_cast<int>(std::ceil(1.2 * step_length / pitch_mm)) + 1;
  double best = INFINITY;
  for (int i = -reach; i <= reach; ++i)
    for (int j = 0; j <= reach; ++j) {
      const Eigen::Vector2d vector = steps * Eigen::Vector2d(i, j);
      if (vector.isZero() || std::abs(vector.norm() - step_length) > 2 * limit_mm) continue;
      const std::complex<double> turn = dots[1] / std::complex(vector.x(), vector.y());
      best = std::min(best, grown_misfit(dots, steps, turn / std::abs(turn)));
      if (best <= limit_mm) return best;
    }
  return std::nullopt;
}

}  // namespace helicarm::phantom
