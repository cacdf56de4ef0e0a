// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/plan_errors.h"

#include <cmath>

#include <gmock/gmock.h>

namespace helicarm::case_registration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using testing::HasSubstr;

RegisteredPoint point_with(const char* name, double sigma_mm, std::optional<double> sigma_in_tool_mm) {
  RegisteredPoint point{name, {}};
  point.place.covariance_in_calibrator = sigma_mm * sigma_mm * Matrix3d::Identity();
  if (sigma_in_tool_mm)
    point.place.in_tool = {{Vector3d::Zero(), Matrix3d::Zero(), {}, {}},
                           *sigma_in_tool_mm * *sigma_in_tool_mm * Matrix3d::Identity()};
  return point;
}

registration::Registration limited(const std::vector<RegisteredPoint>& points, std::optional<double> limit) {
  registration::Registration result;
  result.name = "femur";
  result.decision = registration::Decision::accept;
  limit_error(largest_error(points), limit, result);
  return result;
}

TEST(PlanErrors, APlannedPointBeyondTheLimitIsRefused) {
  const auto result = limited({point_with("near", 0.1, {}), point_with("far", 0.2, {})}, 0.4);
  ASSERT_TRUE(result.failure);
  EXPECT_EQ(result.failure->reason, Reason::uncertain);
  EXPECT_EQ(result.decision, registration::Decision::refuse);
  EXPECT_THAT(result.failure->message, HasSubstr("in the world frame, over the limit of 0.4 mm"));
  EXPECT_THAT(result.failure->message, HasSubstr("\"far\" is 0.5"));
}

TEST(PlanErrors, TheToolsFrameCountsToo) {
  const std::vector<RegisteredPoint> points = {point_with("end", 0.1, 0.3)};
  EXPECT_FALSE(limited(points, 1).failure);
  const auto result = limited(points, 0.5);
  ASSERT_TRUE(result.failure);
  EXPECT_THAT(result.failure->message, HasSubstr("in the tool's frame"));
}

TEST(PlanErrors, WithoutALimitTwoMillimetresAreWarnedOf) {
  EXPECT_EQ(limited({point_with("end", 0.5, {})}, {}).decision, registration::Decision::accept);
  const auto result = limited({point_with("end", 1, {})}, {});
  EXPECT_FALSE(result.failure);
  EXPECT_EQ(result.decision, registration::Decision::warn);
}

TEST(PlanErrors, AnErrorThatIsNotKnownExceedsEveryLimit) {
  EXPECT_TRUE(limited({point_with("start", 0.1, {}), point_with("end", std::nan(""), {})}, 0.5).failure);
}

class NotExplained : public testing::Test {
 protected:
  /// With the part above z = 10 not explained, and a plan of a point and a tunnel at these heights.
  registration::Registration judged(double point_z, double tunnel_z, std::optional<double> diameter_mm = {}) {
    registration::Registration result;
    result.decision = registration::Decision::warn;
    result.not_explained = {Vector3d(0, 0, 10), Vector3d::UnitZ()};
    const MarkupPlan plan{{{"P", {0, 0, point_z}}, {"T_start", {0, 0, -30}}, {"T_end", {0, 0, tunnel_z}}},
                          {{"T", 1, 2, diameter_mm}}};
    judge_explained(plan, result);
    return result;
  }
};

TEST_F(NotExplained, AnythingPlannedInTheRestIsAccepted) {
  const auto result = judged(-5, -5);
  EXPECT_FALSE(result.failure);
  EXPECT_TRUE(result.warnings.empty());
}

TEST_F(NotExplained, APointPlannedThereIsWarnedOf) {
  const auto result = judged(15, -5);
  EXPECT_FALSE(result.failure);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_THAT(result.warnings[0].message, HasSubstr("or within 12 mm of it: P; their"));
}

TEST_F(NotExplained, ATunnelThatReachesThereIsRefused) {
  const auto result = judged(-5, 15);
  ASSERT_TRUE(result.failure);
  EXPECT_EQ(result.failure->reason, Reason::wrong_model);
  EXPECT_THAT(result.failure->message, HasSubstr("or within 12 mm of it: T; their"));
}

TEST_F(NotExplained, TheCutIsKnownToAboutAMarginAndTunnelsAreWide) {
  EXPECT_TRUE(judged(-5, 0).failure);
  EXPECT_FALSE(judged(-5, -4).failure);
  EXPECT_TRUE(judged(-5, -4, 6).failure);
}

}  // namespace
}  // namespace helicarm::case_registration
