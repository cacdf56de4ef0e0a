// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/plate_match.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <set>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/near_points.h"

namespace helicarm::rectification {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector2i;
using Cell = std::pair<int, int>;

/// Columns: the lattice's axes, in pitches.
Matrix2d basis(phantom::Lattice kind) {
  Matrix2d axes;
  axes << lattice_point({1, 0}, kind), lattice_point({0, 1}, kind);
  return axes;
}

Vector2i rounded(const Vector2d& p) {
  return {static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y()))};
}

/// From a dot to the one nearest to it, where they are closest.
Vector2d shortest_step(const std::vector<Vector2d>& dots) {
  Vector2d low = dots.front(), high = low;
  for (const Vector2d& dot : dots) {
    low = low.cwiseMin(dot);
    high = high.cwiseMax(dot);
  }
  const geometry::NearPoints near(dots, (high - low).norm() / std::sqrt(double(dots.size())));
  Vector2d shortest(1e9, 0);
  for (std::size_t i = 0; i < dots.size(); ++i)
    for (const std::size_t j : near.nearest_to(i, 1))
      if (const Vector2d step = dots[j] - dots[i]; step.norm() < shortest.norm() - 1e-6) shortest = step;
  return shortest;
}

/// A plate's lattice: its dots by their indices relative to the first.
class PlateLattice {
 public:
  explicit PlateLattice(std::vector<Vector2i> indices) : indices_(std::move(indices)) {
    for (std::size_t k = 0; k < indices_.size(); ++k) dots_.emplace(key(indices_[k]), k);
  }

  const std::vector<Vector2i>& indices() const { return indices_; }
  /// The first dot there.
  std::optional<std::size_t> dot_at(const Vector2i& index) const {
    const auto found = dots_.find(key(index));
    return found == dots_.end() ? std::nullopt : std::optional(found->second);
  }

 private:
  static std::uint64_t key(const Vector2i& index) {
    return std::uint64_t(std::uint32_t(index.x())) << 32 | std::uint32_t(index.y());
  }

  std::vector<Vector2i> indices_;
  std::unordered_map<std::uint64_t, std::size_t> dots_;
};

/// The dots may be rotated.
PlateLattice lattice_of(const phantom::Plate& plate) {
  const Vector2d origin = plate.dots_mm.front();
  const Vector2d axis = shortest_step(plate.dots_mm);
  const double pitch = plate.pitch_mm.value_or(axis.norm());
  const double sector =
      plate.lattice == phantom::Lattice::square ? std::numbers::pi / 2 : std::numbers::pi / 3;
  const double angle = std::atan2(axis.y(), axis.x());
  const double turn = angle - sector * std::round(angle / sector);
  const Matrix2d to_index =
      (Eigen::Rotation2Dd(turn).toRotationMatrix() * basis(plate.lattice) * pitch).inverse();
  std::vector<Vector2i> indices;
  for (const Vector2d& p : plate.dots_mm) indices.push_back(rounded(to_index * (p - origin)));
  return PlateLattice(std::move(indices));
}

/// All symmetries of a lattice about a node: proper ones first, smallest rotation first.
std::vector<Eigen::Matrix2i> symmetries(phantom::Lattice kind) {
  const int n = kind == phantom::Lattice::square ? 4 : 6;
  const Matrix2d axes = basis(kind);
  std::vector<Eigen::Matrix2i> ways;
  for (const bool mirror : {false, true})
    for (const int k : {0, 1, -1, 2, -2, 3}) {
      if (n == 4 && (k == -2 || k == 3)) continue;
      Matrix2d turn = Eigen::Rotation2Dd(2 * std::numbers::pi * k / n).toRotationMatrix();
      if (mirror) turn.col(0) *= -1;
      const Matrix2d in_index = axes.inverse() * turn * axes;
      ways.push_back(in_index.array().round().cast<int>());
    }
  return ways;
}

}  // namespace

Expected<std::vector<PlateDot>> match_plate(const IndexedLattice& lattice,
                                            const std::vector<detection::Dot>& dots,
                                            const phantom::Plate& plate, const Vector2d& image_centre) {
  std::vector<PlateDot> matched;
  if (plate.dots_mm.empty()) {
    for (const IndexedDot& d : lattice.dots)
      matched.push_back({d.dot, plate.pitch_mm.value_or(1) * lattice_point(d.index, plate.lattice)});
    return matched;
  }
  const PlateLattice own = lattice_of(plate);
  Vector2d own_middle = Vector2d::Zero();
  for (const Vector2i& i : own.indices()) own_middle += i.cast<double>() / double(own.indices().size());
  Vector2d seen_middle = Vector2d::Zero();
  for (const IndexedDot& d : lattice.dots)
    seen_middle += d.index.cast<double>() / double(lattice.dots.size());
  // Position of the plate's centre in the image: an affine map from index to pixel.
  Eigen::MatrixXd design(lattice.dots.size(), 3);
  Eigen::MatrixXd pixels(lattice.dots.size(), 2);
  for (Eigen::Index r = 0; r < design.rows(); ++r) {
    const auto& d = lattice.dots[static_cast<std::size_t>(r)];
    design.row(r) << 1, d.index.x(), d.index.y();
    pixels.row(r) = dots[d.dot].centre_px.transpose();
  }
  const Eigen::Matrix<double, 3, 2> affine = geometry::linear_least_squares(design, pixels).solution;

  int best_score = std::numeric_limits<int>::min();
  double best_distance = 0;
  Eigen::Matrix2i best_way = Eigen::Matrix2i::Identity();
  Vector2i best_shift = Vector2i::Zero();
  int best_hits = 0;
  for (const Eigen::Matrix2i& way : symmetries(plate.lattice)) {
    std::set<Cell> shifts;
    // Every shift that maps one dot to another; on a large plate only those that align the centres.
    const Vector2d about = own_middle - way.cast<double>() * seen_middle;
    for (std::size_t k = 0; k < 3 * own.indices().size(); ++k) {
      // Three anchors, because one of them may be an outlier.
      const Vector2i anchor = way * lattice.dots[(1 + k % 3) * lattice.dots.size() / 4].index;
      const Vector2i shift = own.indices()[k / 3] - anchor;
      if (own.indices().size() < 200 || (shift.cast<double>() - about).norm() < 4)
        shifts.insert({shift.x(), shift.y()});
    }
    for (const Cell& cell : shifts) {
      const Vector2i shift(cell.first, cell.second);
      int hits = 0;
      for (const IndexedDot& d : lattice.dots) hits += own.dot_at(way * d.index + shift).has_value();
      // A detected dot where the plate has none counts against, an undetected plate dot does not.
      const int score = 2 * hits - static_cast<int>(lattice.dots.size());
      const Vector2d middle = way.cast<double>().inverse() * (own_middle - shift.cast<double>());
      const Vector2d pixel = affine.transpose() * Eigen::Vector3d(1, middle.x(), middle.y());
      const double distance = (pixel - image_centre).norm();
      const bool same_way = score == best_score && way == best_way;
      if (score > best_score || (same_way && distance < best_distance)) {
        best_score = score;
        best_distance = distance;
        best_way = way;
        best_shift = shift;
        best_hits = hits;
      }
    }
  }
  const auto strays = static_cast<int>(lattice.dots.size()) - best_hits;
  if (10 * strays > 3 * static_cast<int>(lattice.dots.size()))
    return fail(Reason::plate_mismatch,
                fmt::format("{} of {} dots on the lattice are at positions where the plate \"{}\" has none",
                            strays, lattice.dots.size(), plate.name),
                {{"strays", strays}, {"indexed", double(lattice.dots.size())}});
  for (const IndexedDot& d : lattice.dots)
    if (const auto k = own.dot_at(best_way * d.index + best_shift))
      matched.push_back({d.dot, plate.dots_mm[*k]});
  return matched;
}

}  // namespace helicarm::rectification
