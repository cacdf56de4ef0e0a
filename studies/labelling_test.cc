// SPDX-License-Identifier: Apache-2.0
#include "studies/labelling.h"

#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace helicarm::study {
namespace {

using simulation::OutlierKind;

void expect_same(const LabellingCount& a, const LabellingCount& b) {
  EXPECT_EQ(a.views, b.views);
  EXPECT_EQ(a.solved, b.solved);
  EXPECT_EQ(a.wrong, b.wrong);
  EXPECT_EQ(a.refused, b.refused);
}

TEST(StudyLabelling, EveryViewOffTheAxisIsLabelledAndNoneWrongly) {
  const auto tally = study_labelling(phantom::udcsc(), {.views = 100});
  EXPECT_EQ(tally.all.views, 100);
  EXPECT_EQ(tally.all.wrong, 0);
  EXPECT_GT(tally.spread.views, 40);
  EXPECT_EQ(tally.spread.solved, tally.spread.views);
}

TEST(StudyLabelling, OutliersThatImitateBallsNeverCauseWrongLabels) {
  for (const auto kind : {OutlierKind::imitating, OutlierKind::lattice}) {
    const auto tally = study_labelling(phantom::udcsc(), {.views = 40, .seed = 2, .outliers = kind});
    EXPECT_EQ(tally.all.wrong, 0);
    EXPECT_GE(tally.spread.solved, tally.spread.views - 1);
  }
}

TEST(StudyLabelling, ThreadsDoNotChangeTheCounts) {
  const auto one = study_labelling(phantom::udcsc(), {.views = 20, .seed = 3, .threads = 1});
  const auto three = study_labelling(phantom::udcsc(), {.views = 20, .seed = 3, .threads = 3});
  expect_same(one.all, three.all);
  expect_same(one.spread, three.spread);
  for (std::size_t i = 0; i < one.by_visible.size(); ++i) expect_same(one.by_visible[i], three.by_visible[i]);
}

TEST(StudyLabelling, NoViewsGiveNoCounts) {
  const auto tally = study_labelling(phantom::udcsc(), {.views = 0});
  EXPECT_EQ(tally.all.views, 0);
  EXPECT_EQ(tally.median_ms, 0);
}

/// Prints the figures of docs/method.md; run with --gtest_also_run_disabled_tests.
TEST(StudyLabelling, DISABLED_TenThousandViews) {
  std::vector<std::pair<std::uint64_t, OutlierKind>> runs;
  for (std::uint64_t seed = 101; seed <= 105; ++seed)
    for (const auto kind : {OutlierKind::uniform, OutlierKind::imitating, OutlierKind::lattice})
      runs.push_back({seed, kind});
  for (const auto& [seed, kind] : runs) {
    const auto tally = study_labelling(phantom::udcsc(), {.seed = seed, .outliers = kind});
    fmt::print("seed {}, outliers of kind {}\n", seed, static_cast<int>(kind));
    const auto print = [](const std::string& what, const LabellingCount& count) {
      if (count.views == 0) return;
      fmt::print("{}: {} views, {:.2f} % solved, {} imitated, {} wrong", what, count.views,
                 100.0 * count.solved / count.views, count.imitated, count.wrong);
      for (const auto& [reason, views] : count.refused) fmt::print(", {} {}", code(reason), views);
      fmt::print("\n");
    };
    for (std::size_t i = 0; i < tally.by_visible.size(); ++i)
      print(fmt::format("{:2} visible", i), tally.by_visible[i]);
    print("8 or more, spread", tally.spread);
    print("8 or more, not spread", tally.not_spread);
    fmt::print("ms: median {:.2f}, 99 % {:.2f}\n", tally.median_ms, tally.p99_ms);
    EXPECT_LE(tally.all.wrong, kind == OutlierKind::imitating ? 1 : 0);
  }
}

}  // namespace
}  // namespace helicarm::study
