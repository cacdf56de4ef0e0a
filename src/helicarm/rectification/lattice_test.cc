// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/lattice.h"

#include <cmath>
#include <map>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2i;

struct Scatter {
  std::vector<detection::Dot> dots;
  std::vector<Vector2i> index;  ///< of the first dots; the rest are extra
  double pitch;
};

struct Trouble {
  double missing = 0.3;  ///< fraction of the lattice
  double extra = 0.3;    ///< extra dots relative to those left
  double pincushion_px = 15;
};

/// A field of 1000 px with a lattice of about 9 x 9, rotated within the range that keeps the axes'
/// assignment.
Scatter scatter(phantom::Lattice kind, const Trouble& trouble, std::uint64_t seed) {
  RandomStream random(seed, 1);
  Scatter made;
  made.pitch = random.uniform(60, 110);
  const double sector = kind == phantom::Lattice::square ? M_PI / 2 : M_PI / 3;
  const Eigen::Rotation2Dd turn(random.uniform(-0.35, 0.35) * sector);
  const Vector2d shift(random.uniform(-30, 30), random.uniform(-30, 30));
  for (int j = -12; j <= 12; ++j)
    for (int i = -18; i <= 18; ++i) {
      const Vector2d p = turn * (made.pitch * lattice_point({i, j}, kind)) + shift;
      if (p.norm() > 430 || random.uniform() < trouble.missing) continue;
      detection::Dot dot;
      dot.centre_px = Vector2d(500, 500) +
                      (1 + trouble.pincushion_px / 430 * (p.squaredNorm() / (430 * 430))) * p +
                      0.3 * Vector2d(random.normal(), random.normal());
      made.dots.push_back(dot);
      made.index.emplace_back(i, j);
    }
  for (auto n = static_cast<std::size_t>(trouble.extra * double(made.dots.size())); n > 0; --n) {
    detection::Dot stray;
    stray.centre_px = {random.uniform(60, 940), random.uniform(60, 940)};
    made.dots.push_back(stray);
  }
  return made;
}

struct Score {
  int right = 0;
  int wrong = 0;   ///< lattice dots with a wrong index
  int strays = 0;  ///< extra dots that were indexed
};

/// Correct up to the most frequent shift.
Score score(const Scatter& made, const IndexedLattice& lattice) {
  std::map<std::pair<int, int>, int> shifts;
  for (const IndexedDot& d : lattice.dots)
    if (d.dot < made.index.size()) {
      const Vector2i shift = d.index - made.index[d.dot];
      ++shifts[{shift.x(), shift.y()}];
    }
  Score score;
  int named = 0;
  for (const auto& [shift, count] : shifts) {
    score.right = std::max(score.right, count);
    named += count;
  }
  score.wrong = named - score.right;
  score.strays = static_cast<int>(lattice.dots.size()) - named;
  return score;
}

class IndexLatticeOf : public testing::TestWithParam<phantom::Lattice> {};

TEST_P(IndexLatticeOf, CleanLatticeIsIndexedCompletely) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Scatter made = scatter(GetParam(), {0, 0, 15}, seed);
    const Score s = score(made, index_lattice(made.dots, GetParam(), {}));
    EXPECT_EQ(s.right, static_cast<int>(made.dots.size())) << seed;
  }
}

TEST_P(IndexLatticeOf, PitchAgrees) {
  const Scatter made = scatter(GetParam(), {0, 0, 0}, 3);
  EXPECT_NEAR(index_lattice(made.dots, GetParam(), {}).pitch_px / made.pitch, 1, 0.02);
}

TEST_P(IndexLatticeOf, ThirdMissingThirdExtraAndDistorted) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const Scatter made = scatter(GetParam(), {}, seed);
    const Score s = score(made, index_lattice(made.dots, GetParam(), {}));
    EXPECT_EQ(s.wrong, 0) << seed;
    EXPECT_GE(s.right, 0.85 * double(made.index.size())) << seed;
  }
}

TEST_P(IndexLatticeOf, KnownPitchGivesTheSame) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const Scatter made = scatter(GetParam(), {}, seed);
    LatticeOptions options;
    options.pitch_px = 1.03 * made.pitch;
    const Score s = score(made, index_lattice(made.dots, GetParam(), options));
    EXPECT_EQ(s.wrong, 0) << seed;
    EXPECT_GE(s.right, 0.85 * double(made.index.size())) << seed;
  }
}

TEST_P(IndexLatticeOf, IndicesAndDotsAreUnique) {
  const Scatter made = scatter(GetParam(), {}, 7);
  std::map<std::pair<int, int>, int> places;
  std::map<std::size_t, int> dots;
  for (const IndexedDot& d : index_lattice(made.dots, GetParam(), {}).dots) {
    const int times = ++places[{d.index.x(), d.index.y()}];
    EXPECT_EQ(times, 1);
    EXPECT_EQ(++dots[d.dot], 1);
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, IndexLatticeOf,
                         testing::Values(phantom::Lattice::square, phantom::Lattice::hexagonal),
                         [](const auto& kind) {
                           return kind.param == phantom::Lattice::square ? "Square" : "Hexagonal";
                         });

TEST(IndexLattice, FewDotsGiveNoLattice) {
  EXPECT_TRUE(index_lattice({}, phantom::Lattice::square, {}).dots.empty());
  const Scatter made = scatter(phantom::Lattice::square, {0, 0, 0}, 1);
  EXPECT_TRUE(
      index_lattice({made.dots.begin(), made.dots.begin() + 4}, phantom::Lattice::square, {}).dots.empty());
}

TEST(IndexLattice, CoincidentDotsGiveNoLattice) {
  EXPECT_TRUE(index_lattice(std::vector<detection::Dot>(50), phantom::Lattice::square, {}).dots.empty());
}

TEST(LatticePoint, HexagonalNeighboursAreOnePitchApart) {
  for (const Vector2i& step : {Vector2i(1, 0), Vector2i(0, 1), Vector2i(-1, 1)})
    EXPECT_NEAR(lattice_point(step, phantom::Lattice::hexagonal).norm(), 1, 1e-15);
}

}  // namespace
}  // namespace helicarm::rectification
