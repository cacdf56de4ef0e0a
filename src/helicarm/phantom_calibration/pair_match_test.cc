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

TEST(PairMatch, HalfTheImageSizeGivesTheSamePairs) {
  const auto views = two_views(4);
  auto half = views;
  for (auto& view : half)
    for (PlainCandidate& candidate : view) candidate.uv /= 2;
  const auto pairs_of = [](const std::vector<PairHypothesis>& hypotheses) {
    std::vector<std::vector<std::pair<int, int>>> pairs;
    for (const PairHypothesis& h : hypotheses) pairs.push_back(h.matches);
    return pairs;
  };
  const auto expected = pairs_of(match_pair(views[0], views[1], 10));
  EXPECT_EQ(pairs_of(match_pair(half[0], half[1], 10, 0.5)), expected);
  EXPECT_NE(pairs_of(match_pair(half[0], half[1], 10)), expected);
}

TEST(PairMatch, FourCandidatesAreTooFew) {
  auto views = two_views(0);
  views[0].resize(4);
  EXPECT_TRUE(match_pair(views[0], views[1], 60).empty());
}

}  // namespace
}  // namespace helicarm::phantom_calibration
