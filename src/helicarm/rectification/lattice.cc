// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/lattice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <map>
#include <numbers>

#include "helicarm/geometry/near_points.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2i;

std::vector<Vector2d> centres_of(const std::vector<detection::Dot>& dots) {
  std::vector<Vector2d> centres;
  for (const detection::Dot& dot : dots) centres.push_back(dot.centre_px);
  return centres;
}

/// Nearest dot to a position within `reach`, or -1.
int nearest_dot(const geometry::NearPoints& near, const Vector2d& position, double reach) {
  int best = -1;
  double least = reach * reach;
  near.visit(position, reach, [&](std::size_t i, double squared) {
    if (squared < least) {
      least = squared;
      best = static_cast<int>(i);
    }
  });
  return best;
}

/// Of each dot to another, in order of their columns, which end each search.
std::vector<double> nearest_distances(const std::vector<detection::Dot>& dots) {
  std::vector<Vector2d> by_column = centres_of(dots);
  std::ranges::sort(by_column, {}, [](const Vector2d& centre) { return centre.x(); });
  std::vector<double> nearest(dots.size(), 1e9);
  for (std::size_t i = 0; i < by_column.size(); ++i) {
    const auto is_near = [&](std::size_t j) {
      nearest[i] = std::min(nearest[i], (by_column[j] - by_column[i]).norm());
      return std::abs(by_column[j].x() - by_column[i].x()) < nearest[i];
    };
    for (std::size_t j = i + 1; j < by_column.size() && is_near(j); ++j) continue;
    for (std::size_t j = i; j > 0 && is_near(j - 1); --j) continue;
  }
  return nearest;
}

double commonest_spacing(const std::vector<detection::Dot>& dots) {
  std::vector<double> nearest = nearest_distances(dots);
  std::sort(nearest.begin(), nearest.end());
  // The densest interval: most values within 8 % of one another.
  std::size_t most = 0;
  double spacing = 0;
  for (std::size_t i = 0, j = 0; i < nearest.size(); ++i) {
    while (j < nearest.size() && nearest[j] < 1.08 * nearest[i]) ++j;
    if (j - i > most) {
      most = j - i;
      spacing = nearest[i + (j - i) / 2];
    }
  }
  return spacing;
}

std::vector<Vector2i> steps_of(phantom::Lattice kind) {
  if (kind == phantom::Lattice::square) return {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
  return {{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};
}

struct Seed {
  std::size_t dot;
  Vector2d a, b;
  double misfit;
};

/// Dots whose neighbours match the lattice, best first.
std::vector<Seed> seeds(const std::vector<detection::Dot>& dots, const geometry::NearPoints& near,
                        phantom::Lattice kind, double pitch, double tolerance) {
  const double turn = kind == phantom::Lattice::square ? std::numbers::pi / 2 : std::numbers::pi / 3;
  std::vector<Seed> found;
  for (std::size_t i = 0; i < dots.size(); ++i) {
    const Vector2d here = dots[i].centre_px;
    near.visit(here, 1.3 * pitch, [&](std::size_t j, double) {
      const Vector2d a = dots[j].centre_px - here;
      if (i == j || std::abs(a.norm() / pitch - 1) > tolerance) return;
      if (std::abs(std::atan2(a.y(), a.x())) > turn / 2 + 1e-9) return;  // the axis nearest to +u
      const Eigen::Rotation2Dd rotate(turn);
      const int k = nearest_dot(near, here + rotate * a, 0.2 * pitch);
      if (k < 0) return;
      const Vector2d b = dots[static_cast<std::size_t>(k)].centre_px - here;
      double misfit = (b - rotate * a).norm();
      int there = 0;
      for (const Vector2i& step : steps_of(kind)) {
        const Vector2d position = here + step.x() * a + step.y() * b;
        if (const int n = nearest_dot(near, position, 0.2 * pitch); n >= 0) {
          ++there;
          misfit += (dots[static_cast<std::size_t>(n)].centre_px - position).norm();
        } else {
          misfit += pitch;
        }
      }
      if (there >= 3) found.push_back({i, a, b, misfit});
    });
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Seed& x, const Seed& y) { return x.misfit < y.misfit; });
  return found;
}

struct IndexLess {
  bool operator()(const Vector2i& p, const Vector2i& q) const {
    return p.x() != q.x() ? p.x() < q.x() : p.y() < q.y();
  }
};
using Places = std::map<Vector2i, std::size_t, IndexLess>;

/// Local step vectors at a placed dot, from its placed neighbours if there are any, else inherited.
struct Frame {
  Vector2d a, b;
};

Places grow(const std::vector<detection::Dot>& dots, const geometry::NearPoints& near, phantom::Lattice kind,
            double pitch, const Seed& seed, const LatticeOptions& options) {
  Places places;
  std::map<Vector2i, Frame, IndexLess> frames;
  std::vector<bool> taken(dots.size(), false);
  std::deque<Vector2i> queue{{0, 0}};
  places[{0, 0}] = seed.dot;
  frames[{0, 0}] = {seed.a, seed.b};
  taken[seed.dot] = true;
  const auto refined = [&](const Vector2i& at, const Frame& frame) {
    // Differences to placed neighbours, averaged with the inherited vectors.
    Vector2d sum_a = frame.a;
    Vector2d sum_b = frame.b;
    int na = 1;
    int nb = 1;
    const Vector2d here = dots[places.at(at)].centre_px;
    for (const int sign : {1, -1}) {
      if (const auto n = places.find(at + Vector2i(sign, 0)); n != places.end()) {
        sum_a += sign * (dots[n->second].centre_px - here);
        ++na;
      }
      if (const auto n = places.find(at + Vector2i(0, sign)); n != places.end()) {
        sum_b += sign * (dots[n->second].centre_px - here);
        ++nb;
      }
    }
    return Frame{sum_a / na, sum_b / nb};
  };
  while (!queue.empty()) {
    const Vector2i at = queue.front();
    queue.pop_front();
    const Frame frame = refined(at, frames.at(at));
    frames[at] = frame;
    const Vector2d here = dots[places.at(at)].centre_px;
    for (const Vector2i& step : steps_of(kind))
      for (int gap = 1; gap <= options.max_gap; ++gap) {
        const Vector2i next = at + gap * step;
        if (places.contains(next)) break;
        const Vector2d position = here + gap * (step.x() * frame.a + step.y() * frame.b);
        const int n = nearest_dot(near, position, options.match_tolerance * pitch);
        if (n < 0 || taken[static_cast<std::size_t>(n)]) continue;
        places[next] = static_cast<std::size_t>(n);
        frames[next] = frame;
        taken[static_cast<std::size_t>(n)] = true;
        queue.push_back(next);
        break;
      }
  }
  return places;
}

}  // namespace

Vector2d lattice_point(const Vector2i& index, phantom::Lattice kind) {
  if (kind == phantom::Lattice::square) return index.cast<double>();
  return {index.x() + 0.5 * index.y(), 0.5 * std::numbers::sqrt3 * index.y()};
}

IndexedLattice index_lattice(const std::vector<detection::Dot>& dots, phantom::Lattice kind,
                             const LatticeOptions& options) {
  IndexedLattice lattice;
  if (dots.size() < 5) return lattice;
  const double pitch = options.pitch_px.value_or(commonest_spacing(dots));
  if (!(pitch > 2)) return lattice;
  const geometry::NearPoints near(centres_of(dots), 1.3 * pitch);
  const double tolerance = options.pitch_px ? options.pitch_tolerance + 0.05 : 0.2;
  const std::vector<Seed> starts = seeds(dots, near, kind, pitch, tolerance);
  Places best;
  Vector2d best_a = Vector2d::Zero();
  const std::size_t tries = std::min<std::size_t>(starts.size(), dots.size() > 500 ? 3 : 12);
  for (std::size_t k = 0; k < tries; ++k) {
    Places places = grow(dots, near, kind, pitch, starts[k], options);
    if (places.size() > best.size()) {
      best = std::move(places);
      best_a = starts[k].a;
    }
    if (4 * best.size() > 3 * dots.size()) break;
  }
  if (best.size() < 5) return lattice;
  for (const auto& [index, dot] : best) lattice.dots.push_back({dot, index});
  lattice.pitch_px = best_a.norm();
  return lattice;
}

}  // namespace helicarm::rectification
