// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/pair_match.h"

#include <gtest/gtest.h>

#include "helicarm/phantom_calibration/synthetic_phantom_test.h"

namespace helicarm::phantom_calibration {
namespace {

/// Two views of the helix, 20 degrees apart; candidate i is fiducial i, false ones follow.
std::vector<std::vector<PlainCandidate>> two_views(int false_ones) {
  RandomStream random(1, 1, 0);
  std::vector<std::vector<PlainCandidate>> views(2);
  for (int v = 0; v < 2; ++v) {
    const geometry::View view = synthetic_view(v, random);
    for (const Eigen::Vector3d& centre : helix_centres())
      views[std::size_t(v)].push_back(
          {view.project(centre) - Eigen::Vector2d(view.intrinsics.u0, view.intrinsics.v0), 0});
    for (int i = 0; i < false_ones; ++i)
      views[std::size_t(v)].push_back({{random.uniform(-400, 400), random.uniform(-400, 400)}, 0});
  }
  return views;
}

/// The most right matches among the hypotheses.
int most_right(const std::vector<PairHypothesis>& hypotheses) {
  int most = 0;
  for (const PairHypothesis& h : hypotheses)
    most = std::max(most, int(std::ranges::count_if(
                              h.matches, [](const auto& m) { return m.first == m.second && m.first < 12; })));
  return most;
}

TEST(PairMatch, HypothesesHoldTheRightPairs) {
  const auto views = two_views(0);
  EXPECT_GE(most_right(match_pair(views[0], views[1], 60)), 10);
}

TEST(PairMatch, FourFalseCandidatesAreBorne) {
  const auto views = two_views(4);
  EXPECT_GE(most_right(match_pair(views[0], views[1], 60)), 9);
}

TEST(PairMatch, FiducialsOfDifferentKindsAreNotPaired) {
  auto views = two_views(0);
  for (std::size_t i = 0; i < 12; ++i) views[0][i].kind = views[1][i].kind = int(i % 2);
  for (const PairHypothesis& h : match_pair(views[0], views[1], 60))
    for (const auto& [i, k] : h.matches) EXPECT_EQ(i % 2, k % 2);
}

TEST(PairMatch, FourCandidatesAreTooFew) {
  auto views = two_views(0);
  views[0].resize(4);
  EXPECT_TRUE(match_pair(views[0], views[1], 60).empty());
}

}  // namespace
}  // namespace helicarm::phantom_calibration
