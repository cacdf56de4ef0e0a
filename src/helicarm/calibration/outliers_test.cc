// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/outliers.h"

#include <cmath>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/calibration/view_problem.h"
#include "helicarm/calibration/views_test.h"
#include "helicarm/core/random_vectors.h"

namespace helicarm::calibration {
namespace {

constexpr double probability = 1e-3;
constexpr std::size_t least_kept = 6;

using Removed = std::set<std::pair<std::size_t, std::size_t>>;

/// The same test with a whole fit for each possible removal.
Removed removed_by_fits(std::vector<ViewProblem> problems, const CommonPrior& common) {
  auto fit = refine(problems, common).value();
  std::vector<std::vector<std::size_t>> indices;
  std::size_t count = 0;
  for (const ViewProblem& problem : problems) {
    std::vector<std::size_t>& own = indices.emplace_back();
    for (std::size_t i = 0; i < problem.observations.size(); ++i) own.push_back(i);
    count += own.size();
  }
  Removed removed, significant;
  for (std::size_t round = 0; round < count / 3; ++round) {
    std::optional<Refinement> best;
    std::pair<std::size_t, std::size_t> which;
    for (std::size_t v = 0; v < problems.size(); ++v)
      for (std::size_t i = 0; i < problems[v].observations.size(); ++i) {
        if (problems[v].observations.size() <= least_kept) continue;
        auto without = problems;
        without[v].observations.erase(without[v].observations.begin() + std::ptrdiff_t(i));
        auto after = refine(without, common);
        if (after && (!best || after->chi2 < best->chi2)) best = *std::move(after), which = {v, i};
      }
    if (!best) break;
    auto& [v, i] = which;
    problems[v].observations.erase(problems[v].observations.begin() + std::ptrdiff_t(i));
    removed.emplace(v, indices[v][i]);
    indices[v].erase(indices[v].begin() + std::ptrdiff_t(i));
    const double dof = 8 + best->dof, variance = std::max(1.0, (8 + best->chi2) / dof);
    if (std::pow(1 + (fit.chi2 - best->chi2) / variance / dof, -dof / 2) < probability) significant = removed;
    fit = *std::move(best);
  }
  return significant;
}

struct Case {
  std::vector<ViewProblem> problems;
  CommonPrior common;
};

/// Four views of twelve balls, of which some in some views are displaced by up to 3 px.
Case with_displaced(std::uint64_t seed, int displaced) {
  RandomStream random(seed, 0);
  Case made;
  made.common.c_arm = {IntrinsicsVariation{2, 0.5}, IntrinsicsVariation{2, 0.5}};
  std::vector<ViewFiducials> views;
  for (const double alpha : {0.0, 0.5, 1.0, 1.6}) {
    views.push_back(observed_fiducials(fmt::format("V{}", views.size()), paper_view(alpha), 0.1, random));
    views.back().prior.focal_px = 6000;
    views.back().prior.unit_px = 1 / 0.15;
  }
  for (int k = 0; k < displaced; ++k)
    views[std::size_t(k) % views.size()].fiducials[std::size_t(3 + 2 * k) % 12].uv += 3 * normal_2(random);
  for (const ViewFiducials& view : views) made.problems.push_back(problem_of(view, {}).value());
  return made;
}

TEST(Outliers, AreThoseThatWholeFitsFind) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const Case the_case = with_displaced(seed, int(seed) - 1);
    const auto clean = refine_without_outliers(the_case.problems, the_case.common, probability, least_kept);
    ASSERT_TRUE(clean) << clean.error().message;
    Removed removed;
    for (const auto& [view, observation] : clean->removed) removed.emplace(view, observation);
    EXPECT_THAT(removed, testing::ContainerEq(removed_by_fits(the_case.problems, the_case.common))) << seed;
  }
}

TEST(Outliers, LeaveTheFitWithoutThem) {
  const Case the_case = with_displaced(3, 3);
  const auto clean = refine_without_outliers(the_case.problems, the_case.common, probability, least_kept);
  ASSERT_TRUE(clean && !clean->removed.empty());
  std::size_t left = 0;
  for (const ViewProblem& problem : clean->problems) left += problem.observations.size();
  EXPECT_EQ(left + clean->removed.size(), 48u);
  EXPECT_NEAR(clean->fit.chi2, refine(clean->problems, the_case.common)->chi2, 1e-6);
}

}  // namespace
}  // namespace helicarm::calibration
