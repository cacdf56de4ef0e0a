// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/wire_grid.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/simulation/simulate_case.h"

namespace helicarm::simulation {
namespace {

SimulationOptions small_grid(std::vector<double> distances_mm) {
  SimulationOptions options;
  options.seed = 3;
  options.kind = CaseKind::grid;
  options.size = 512;
  options.grid_distances_mm = std::move(distances_mm);
  return options;
}

TEST(WireGrid, PlateComesFirstAndStaysWhileTheGridMoves) {
  const SimulatedCase simulated = *simulate_case(small_grid({30, 120}));
  ASSERT_EQ(simulated.views.size(), 3u);
  EXPECT_EQ(simulated.views[0].true_view.name, "PLATE");
  EXPECT_EQ(simulated.views[1].true_view.name, "GRID-30");
  EXPECT_EQ(simulated.views[2].true_view.name, "GRID-120");
  EXPECT_TRUE(simulated.views[0].crosses.empty());
  EXPECT_FALSE(simulated.options.knee);
  for (const SimulatedView& view : simulated.views)
    for (std::size_t i = 0; i < view.plate_dots.size(); ++i)
      EXPECT_LT((view.plate_dots[i].raw - simulated.views[0].plate_dots[i].raw).norm(), 1e-6);
  for (std::size_t i = 1; i < 3; ++i) {
    const TrueView& true_view = simulated.views[i].true_view;
    const double depth = true_view.view.camera_from_world.translation.z();
    EXPECT_NEAR(true_view.f_mm - depth, i == 1 ? 30 : 120, 1e-9);
    ASSERT_EQ(simulated.views[i].crosses.size(), 81u);
  }
}

TEST(WireGrid, CrossesAreDarkestAtTheirTruePositions) {
  const SimulatedCase simulated = *simulate_case(small_grid({45}));
  const SimulatedView& view = simulated.views[1];
  EXPECT_EQ(view.true_view.name, "GRID");
  int clear = 0;
  for (const TruePoint& cross : view.crosses) {
    if (cross.visibility != Visibility::clear || (cross.raw - Eigen::Vector2d(255.5, 255.5)).norm() > 230)
      continue;
    ++clear;
    const int u = static_cast<int>(std::lround(cross.raw.x()));
    const int v = static_cast<int>(std::lround(cross.raw.y()));
    int brighter = 0;  // 10 px beside it is the mesh's interior, possibly with a dot in one of its corners
    for (const int side : {-10, 10})
      for (const int upright : {-10, 10})
        brighter += view.pixels(u, v) < 0.8 * view.pixels(u + side, v + upright);
    EXPECT_GE(brighter, 3) << cross.name;
  }
  EXPECT_GE(clear, 40);
}

TEST(WireGrid, InvalidScenesAreRefused) {
  const auto reason = [](const SimulationOptions& options) { return simulate_case(options).error().reason; };
  for (const std::vector<double>& distances :
       {std::vector<double>{}, {19}, {501}, {45, 45}, {45, std::nan("")}, std::vector<double>(21, 45)})
    EXPECT_EQ(reason(small_grid(distances)), Reason::bad_value);
  SimulationOptions options = small_grid({45});
  options.preset = Preset::paper_sim;
  EXPECT_EQ(reason(options), Reason::bad_value);
  options = small_grid({45});
  options.faults = {Fault::screws};
  EXPECT_EQ(reason(options), Reason::bad_value);
  options.faults = {};
  options.lost_balls = {"P1"};
  EXPECT_EQ(reason(options), Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::simulation
