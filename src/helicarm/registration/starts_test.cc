// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/starts.h"

#include <gmock/gmock.h>

#include "helicarm/registration/scene_test.h"

namespace helicarm::registration {
namespace {

using geometry::RigidTransform;

constexpr double same_mm = 1.5;

class Search : public testing::Test {
 protected:
  /// The true pose moved (degrees, mm) about the model's centre.
  RigidTransform moved(double rx, double ry, double rz, double x, double y, double z) const {
    RigidStep step;
    step << rx, ry, rz, x, y, z;
    step.head<3>() *= EIGEN_PI / 180;
    return moved_about(true_pose(), true_pose() * model_.centre, step);
  }
  SearchResult found(const std::vector<RigidTransform>& starts, int keep, double most_ratio = 1e9) const {
    RegistrationProblem scene(model_, views_, 1);
    SearchOptions options;
    options.candidates = 0;  // the starts alone
    return search(scene, {{{false, 4}}, {{false, 1}, keep, most_ratio}}, starts, options, same_mm);
  }

  const volume::Volume volume_ = lopsided_bone();
  const Model model_ = *model_from("bone", volume_, std::nullopt, HuWindow{150, 3000});
  const std::vector<RegistrationView> views_ = two_views(volume_);
};

TEST_F(Search, AStartDoesNotAgreeWithItself) {
  RegistrationProblem scene(model_, views_, 1);
  SearchOptions options;
  options.candidates = 1;  // the first is the start
  const auto result =
      search(scene, {{{false, 4}, 4}, {{false, 1}}}, {moved(2, 0, 0, 1, 1, 0)}, options, same_mm);
  EXPECT_EQ(result.starts, 1);
  EXPECT_EQ(result.agree, 1);
}

TEST_F(Search, PoseThatMergesWithTheBestIsNoRival) {
  const auto result = found({moved(3, 0, -2, 2, 1, 0), moved(-2, 3, 0, -1, 0, 2)}, 3);
  EXPECT_EQ(result.agree, 2);
  EXPECT_EQ(result.solutions.size(), 1u);
  EXPECT_FALSE(result.runner_up);
}

TEST_F(Search, PoseThatGoesOnBesideTheBestIsTheRival) {
  const auto result = found({moved(2, 0, 0, 1, 1, 0), moved(0, 0, 180, 0, 0, 0)}, 3);
  EXPECT_EQ(result.agree, 1);
  ASSERT_TRUE(result.runner_up);
  EXPECT_GT(separation(model_, result.runner_up->pose, true_pose()), 10);
  EXPECT_LT(result.runner_up->score, result.runner_up_best);
}

TEST_F(Search, PoseLeftBehindIsTheRival) {
  for (const bool by_cost : {false, true}) {
    const auto result =
        found({moved(2, 0, 0, 1, 1, 0), moved(0, 0, 180, 0, 0, 0)}, by_cost ? 3 : 1, by_cost ? 1.0001 : 1e9);
    EXPECT_EQ(result.solutions.size(), 1u);
    EXPECT_LT(separation(model_, result.solutions[0].pose, true_pose()), 0.3);
    ASSERT_TRUE(result.runner_up);
    EXPECT_GT(separation(model_, result.runner_up->pose, true_pose()), 10);
    EXPECT_GT(1 - result.runner_up->score, 1 - result.runner_up_best);
  }
}

}  // namespace
}  // namespace helicarm::registration
