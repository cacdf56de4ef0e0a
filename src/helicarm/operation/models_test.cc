// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/models.h"

#include <gmock/gmock.h>

namespace helicarm::operation {
namespace models_test {

using Eigen::Vector3d;
using testing::HasSubstr;

OperationPlan plan() {
  OperationPlan plan;
  plan.drill = HandDrill{{0, -140, 20}, {0, -20, 20}, 0.1};
  plan.tunnels = {{"ACL", "femur", "ACL-1", "ACL-2", TunnelEnd::start}};
  plan.tunnels[0].of_model.emplace().model = "knee";
  plan.tracker.sigma_mm = 0.1;
  plan.tracker.sigma_deg = 0.03;
  return plan;
}

/// The registration leaves these standard deviations per axis.
pipeline::Result registered(double start_mm, double end_mm) {
  pipeline::Result result;
  for (const auto& [name, z, sigma] : {std::tuple("ACL-1", 0, start_mm), {"ACL-2", 40, end_mm}}) {
    pipeline::ModelPoint point;
    point.model = "knee";
    point.name = name;
    point.place.in_bones["femur"].propagated = {
        Vector3d(30, 5, z), sigma * sigma * Eigen::Matrix3d::Identity(), {}, {}};
    result.model_points.push_back(point);
  }
  return result;
}

guidance::Poses poses() {
  guidance::Poses now;
  now.tracker_from_bone["femur"] = {Eigen::Matrix3d::Identity(), {-50, 0, 880}};
  now.tracker_from_tool = geometry::RigidTransform{Eigen::Matrix3d::Identity(), {-20, 140, 860}};
  return now;
}

Expected<void> check(const pipeline::Result& result) {
  return check_error_at_tip(plan(), plan().tunnels[0], result, poses(), tracked_tool(*plan().drill));
}

TEST(ErrorAtTip, WithinTheLimitIsAccepted) { EXPECT_TRUE(check(registered(0.3, 0.3))); }

TEST(ErrorAtTip, RefusalNamesTheWorseEndItsErrorTheLimitAndTheCauses) {
  const auto refused = check(registered(0.9, 1.2));
  ASSERT_FALSE(refused);
  const Failure& why = refused.error();
  EXPECT_EQ(why.reason, Reason::uncertain);
  EXPECT_THAT(why.message, HasSubstr("ACL: the 95 % error of \"ACL-2\" at the tool's tip is"));
  EXPECT_THAT(why.message, HasSubstr("limit of 2 mm; by the registration alone"));
  EXPECT_THAT(why.message, HasSubstr("the drill's calibration"));
  const auto figure = [&](const char* name) { return why.figures.at(name); };
  EXPECT_NEAR(figure("registration_95_mm"), 1.2 * 2.795, 0.02);  // of three equal axes
  EXPECT_GT(figure("error_95_mm"), figure("registration_95_mm"));
  EXPECT_LT(figure("tracker_95_mm"), 1);
  EXPECT_GT(figure("tool_95_mm"), 0);
}

TEST(ErrorAtTip, IsThatOfTheTipAtTheTunnelWhereverTheToolIs) {
  const auto error_from = [](double away_mm) {
    guidance::Poses now = poses();
    now.tracker_from_tool->translation.z() -= away_mm;
    const auto refused =
        check_error_at_tip(plan(), plan().tunnels[0], registered(0.9, 1.2), now, tracked_tool(*plan().drill));
    return refused.error().figures.at("error_95_mm");
  };
  EXPECT_NEAR(error_from(400), error_from(0), 1e-9);
}

TEST(ErrorAtTip, OfAPickedTunnelIsLimitedToo) {
  OperationPlan picked = plan();
  picked.tunnels[0].of_model.reset();
  const auto located = [](double sigma_mm) {
    pipeline::Result result;
    for (const char* name : {"ACL-1", "ACL-2"}) {
      pipeline::PointResult point{
          name, localization::PointSource::pick, "femur", {}, guidance::PointInFrames{}, 0, {}};
      point.place->in_bones["femur"].propagated = {
          {30, 5, 20}, sigma_mm * sigma_mm * Eigen::Matrix3d::Identity(), {}, {}};
      result.points.push_back(point);
    }
    return result;
  };
  const TrackedTool tool = tracked_tool(*picked.drill);
  EXPECT_TRUE(check_error_at_tip(picked, picked.tunnels[0], located(0.3), poses(), tool));
  const auto refused = check_error_at_tip(picked, picked.tunnels[0], located(1.2), poses(), tool);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::uncertain);
  EXPECT_THAT(refused.error().message, HasSubstr("by the X-ray images alone"));
  EXPECT_GT(refused.error().figures.at("images_95_mm"), 2);
}

}  // namespace models_test
}  // namespace helicarm::operation
