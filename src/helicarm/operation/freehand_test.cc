// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/freehand.h"

#include <gmock/gmock.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/view_json.h"

namespace helicarm::operation {
namespace freehand_test {

using Eigen::Vector3d;
using geometry::RigidTransform;

const RigidTransform tracker_from_femur{geometry::rotation_from_euler(1, 0, 0), {-50, 0, 880}};
/// In the femur marker's frame: the tunnel begins here and extends by 40 mm along z.
const Vector3d entry(30, 5, -20);
constexpr double end_s = 100;
constexpr double oldest_s = 0.1;

OperationPlan plan() {
  OperationPlan plan;
  plan.drill = HandDrill{{0, -140, 20}, {0, -20, 20}, 0.1};
  plan.tunnels = {{"femur", "femur", "FS", "FE", TunnelEnd::start}};
  plan.tracker.sigma_mm = 0.1;
  plan.tracker.sigma_deg = 0.03;
  return plan;
}

pipeline::Result measured() {
  pipeline::Result result;
  for (const auto& [name, at] : {std::pair("FS", entry), {"FE", Vector3d(entry + Vector3d(0, 0, 40))}}) {
    pipeline::PointResult point{
        name, localization::PointSource::pick, "femur", {}, guidance::PointInFrames{}, 0, {}};
    point.place->in_bones["femur"].propagated = {at, 0.01 * Eigen::Matrix3d::Identity(), {}, {}};
    result.points.push_back(point);
  }
  return result;
}

/// The tip this far from the tunnel's axis and this deep, tilted.
RigidTransform femur_from_tip(double off_mm, double depth_mm, double tilt_rad = 0) {
  return {geometry::rotation_from_vector(Vector3d(tilt_rad, 0, 0)), entry + Vector3d(off_mm, 0, depth_mm)};
}

RigidTransform tracker_from_tool(const RigidTransform& tracker_from_bone,
                                 const RigidTransform& bone_from_tip) {
  return tracker_from_bone * bone_from_tip * tracked_tool(*plan().drill).marker_from_tip.inverse();
}

FreehandGuide guide() {
  guidance::Poses basis;
  basis.tracker_from_bone["femur"] = tracker_from_femur;
  basis.tracker_from_tool = tracker_from_tool(tracker_from_femur, femur_from_tip(0, -20));
  return FreehandGuide::begin(plan(), LiveTool(plan(), measured(), {}, tracked_tool(*plan().drill)), "femur",
                              basis, oldest_s)
      .value();
}

/// Fifteen samples until `end_s`; `tip` by the sample's number.
template <class Tip>
PoseWindow window(const Tip& tip, const RigidTransform& tracker_from_bone = tracker_from_femur) {
  PoseWindow window{end_s - 0.25, 0.25, {}};
  for (int i = 0; i < 15; ++i) {
    const double time_s = end_s - (14 - i) / 30.0;
    window.samples["femur"].push_back({time_s, 0, time_s, tracker_from_bone});
    window.samples["tool"].push_back({time_s, 0, time_s, tracker_from_tool(tracker_from_bone, tip(i))});
  }
  return window;
}

PoseWindow at_rest(const RigidTransform& tip, const RigidTransform& bone = tracker_from_femur) {
  return window([&](int) { return tip; }, bone);
}

TEST(FreehandGuide, DrillOnTheAxisIsOnTarget) {
  const Guidance now = guide().at(at_rest(femur_from_tip(0.3, 25, 0.01)));
  EXPECT_EQ(now.decision(), "on_target");
  EXPECT_NEAR(now.aim->distance_mm, 0.3, 1e-6);
  EXPECT_NEAR(now.aim->depth_mm, 25, 1e-6);
  EXPECT_NEAR(now.aim->to_axis_mm.norm(), 0.3, 1e-6);
  EXPECT_NEAR(now.age_s.value(), 0, 1e-9);
}

TEST(FreehandGuide, CorrectionByTheAimBringsTheDrillOnTheAxis) {
  const RigidTransform tip = femur_from_tip(3, 10, 0.1);
  const TunnelAim aim = *guide().at(at_rest(tip)).aim;
  const RigidTransform correction{geometry::rotation_between(Vector3d::UnitZ(), aim.axis), aim.to_axis_mm};
  const Guidance corrected = guide().at(at_rest(tip * correction));
  EXPECT_NEAR(corrected.aim->distance_mm, 0, 1e-6);
  EXPECT_NEAR(corrected.aim->angle_deg, 0, 1e-6);
}

TEST(FreehandGuide, DrillBesideTiltedOrBeyondIsOffTarget) {
  for (const RigidTransform& tip :
       {femur_from_tip(1.5, 10), femur_from_tip(0, 10, 0.05), femur_from_tip(0, 42)})
    EXPECT_EQ(guide().at(at_rest(tip)).decision(), "off_target");
}

TEST(FreehandGuide, MotionOfTheBoneWithinItsLimitMovesTheTarget) {
  RigidTransform moved = tracker_from_femur;
  moved.translation.x() += 0.6;
  const Guidance now = guide().at(at_rest(femur_from_tip(0, 10), moved));
  EXPECT_EQ(now.decision(), "on_target");
  EXPECT_NEAR(now.bone_moved->distance_mm, 0.6, 1e-9);
  EXPECT_NEAR(now.aim->distance_mm, 0, 1e-6);
}

TEST(FreehandGuide, MotionOfTheBoneBeyondItsLimitIsReported) {
  RigidTransform moved = tracker_from_femur;
  moved.translation.x() += 3.1;
  const Guidance now = guide().at(at_rest(femur_from_tip(0, 10), moved));
  EXPECT_EQ(now.decision(), "plan_stale");
  EXPECT_NEAR(now.why_not->figures.at("distance_mm"), 3.1, 1e-9);
  EXPECT_TRUE(now.aim);
}

TEST(FreehandGuide, PosesOlderThanTheLimitAreStale) {
  PoseWindow late = at_rest(femur_from_tip(0, 10));
  late.middle_s += 0.11;
  EXPECT_EQ(guide().at(late).decision(), "stale_pose");
}

TEST(FreehandGuide, MarkerThatIsNotVisibleHasNoPose) {
  PoseWindow hidden = at_rest(femur_from_tip(0, 10));
  hidden.samples["femur"].clear();
  const Guidance now = guide().at(hidden);
  EXPECT_EQ(now.decision(), "no_pose");
  EXPECT_FALSE(now.aim);
}

TEST(FreehandGuide, ScatteringSamplesAreUncertain) {
  RandomStream random(5, 1);
  const auto shaken = [&](int) { return femur_from_tip(1.5 * random.normal(), 10 + 1.5 * random.normal()); };
  const Guidance now = guide().at(window(shaken));
  EXPECT_EQ(now.decision(), "uncertain");
  EXPECT_GT(now.aim->depth_sigma_mm, 0.3);
}

TEST(FreehandGuide, UncertainDecisionSaysWhatItsErrorsComeFrom) {
  RandomStream random(5, 1);
  const PoseWindow shaken =
      window([&](int) { return femur_from_tip(1.5 * random.normal(), 10 + 1.5 * random.normal()); });
  const Guidance now = guide().at(shaken);
  const AimErrors errors = now.aim->errors.value();
  const auto sum = [](double a, double b, double c, double d) {
    return std::hypot(std::hypot(a, b), std::hypot(c, d));
  };
  EXPECT_NEAR(sum(errors.images.distance_mm, errors.tracker.distance_mm, errors.tool.distance_mm,
                  errors.scatter.distance_mm),
              now.aim->distance_sigma_mm, 1e-9);
  EXPECT_NEAR(
      sum(errors.images.angle_deg, errors.tracker.angle_deg, errors.tool.angle_deg, errors.scatter.angle_deg),
      now.aim->angle_sigma_deg, 1e-9);
  EXPECT_GT(errors.scatter.distance_mm, errors.tool.distance_mm);
  EXPECT_THAT(now.why_not->message,
              testing::AllOf(testing::HasSubstr("tolerances 1 mm and 2 degrees; by the X-ray images"),
                             testing::HasSubstr("the scatter of its poses")));
  const Guidance earlier = guide().at(shaken, {.states_causes = false});  // as earlier versions recorded it
  EXPECT_FALSE(earlier.aim->errors);
  EXPECT_TRUE(earlier.why_not->message.ends_with("tolerances 1 mm and 2 degrees"));
}

TEST(FreehandGuide, SteadyMotionIsNotScatter) {
  const Guidance still = guide().at(at_rest(femur_from_tip(0, 10.5)));
  const Guidance moving = guide().at(window([](int i) { return femur_from_tip(0, i); }));
  EXPECT_NEAR(moving.aim->depth_sigma_mm, still.aim->depth_sigma_mm, 1e-6);
  EXPECT_NEAR(moving.aim->depth_mm, 14 - 3.5, 1e-6);  // the mean of the last eight of 15
  EXPECT_EQ(moving.decision(), "on_target");
}

/// The last samples of a marker alone.
PoseWindow with_last(const std::string& marker, std::ptrdiff_t count) {
  PoseWindow window = at_rest(femur_from_tip(0.3, 25, 0.01));
  auto& samples = window.samples.at(marker);
  samples.erase(samples.begin(), samples.end() - count);
  return window;
}

TEST(FreehandGuide, FewPosesAreUncertain) {
  for (const char* marker : {"tool", "femur"}) {
    for (const std::ptrdiff_t count : {1, 2, 4}) {
      const Guidance now = guide().at(with_last(marker, count));
      EXPECT_EQ(now.decision(), "uncertain") << count << " of " << marker;
      EXPECT_THAT(now.why_not->message, testing::HasSubstr("too few poses"));
      EXPECT_EQ(guide().at(with_last(marker, count), {.counts_poses = false}).decision(), "on_target");
    }
    EXPECT_EQ(guide().at(with_last(marker, 5)).decision(), "on_target") << marker;
  }
}

TEST(FreehandGuide, FewPosesInTheMeanAreUncertain) {
  PoseWindow window = at_rest(femur_from_tip(0.3, 25, 0.01));
  auto& tool = window.samples.at("tool");
  tool.erase(tool.end() - 8, tool.end() - 1);  // one is left in the last quarter of a second
  EXPECT_EQ(guide().at(window).decision(), "uncertain");
}

TEST(FreehandGuide, RecordedSamplesGiveTheSameDecision) {
  const PoseWindow recent = at_rest(femur_from_tip(0.7, 12, 0.02));
  const PoseWindow read = pose_window_from(to_json(recent), "record").value();
  EXPECT_EQ(to_json(guide().at(read)), to_json(guide().at(recent)));
}

TEST(FreehandGuide, ErrorThatIsNotANumberIsUncertain) {
  pipeline::Result unknown = measured();
  unknown.points[1].place->in_bones["femur"].propagated.covariance(0, 0) = std::nan("");
  guidance::Poses basis;
  basis.tracker_from_bone["femur"] = tracker_from_femur;
  basis.tracker_from_tool = tracker_from_tool(tracker_from_femur, femur_from_tip(0, -20));
  const auto guide = FreehandGuide::begin(plan(), LiveTool(plan(), unknown, {}, tracked_tool(*plan().drill)),
                                          "femur", basis, oldest_s)
                         .value();
  EXPECT_EQ(guide.at(at_rest(femur_from_tip(0, 10))).decision(), "uncertain");
}

/// A drill that is not guided.
class MeanAim : public testing::Test {
 protected:
  static constexpr double limit_s = 10;  // of a pose's age

  MeanAim() : board_({.max_age_s = limit_s}) {}
  void see(const std::string& marker, const RigidTransform& tracker_from_marker, double time_s) {
    tracker::IgtlTransform pose;
    pose.matrix = tracker_from_marker.matrix();
    board_.take({marker, tracker::stamp_from_seconds(1.7e9 + time_s), pose}, time_s);
  }
  void see_tool(double time_s) {
    see("tool", tracker_from_tool(tracker_from_femur, femur_from_tip(0.3, 10)), time_s);
  }
  void see_femur(double time_s) { see("femur", tracker_from_femur, time_s); }
  Expected<TunnelAim> aim() const {
    return mean_aim(LiveTool(plan(), measured(), {}, tracked_tool(*plan().drill)), plan().tracker,
                    plan().tunnels[0], board_, end_s);
  }

  tracker::PoseBoard board_;
};

TEST_F(MeanAim, IsThatOfTheRecentPoses) {
  for (const double ago_s : {0.2, 0.16, 0.12, 0.08, 0.04}) see_tool(end_s - ago_s), see_femur(end_s - ago_s);
  EXPECT_NEAR(aim().value().distance_mm, 0.3, 1e-6);
}

TEST_F(MeanAim, OfOnePoseIsUncertain) {
  see_tool(end_s - 0.1), see_femur(end_s - 0.1);
  EXPECT_EQ(aim().error().reason, Reason::uncertain);
}

TEST_F(MeanAim, MarkerSeenOnlyAfterItsTimeHasNoPose) {
  see_tool(end_s - 0.1), see_femur(end_s + 0.1);
  EXPECT_EQ(aim().error().reason, Reason::no_pose);
}

TEST_F(MeanAim, PoseWithinTheAgeLimitThatIsNotRecentIsNone) {
  see_tool(end_s - 0.6), see_femur(end_s - 0.1);
  EXPECT_EQ(aim().error().reason, Reason::no_pose);
}

TEST(FreehandGuide, PlanWithARobotIsRefused) {
  OperationPlan with_robot = plan();
  with_robot.drill.reset();
  EXPECT_EQ(FreehandGuide::begin(with_robot, LiveTool(plan(), measured(), {}, tracked_tool(*plan().drill)),
                                 "femur", {}, oldest_s)
                .error()
                .reason,
            Reason::usage);
}

}  // namespace freehand_test
}  // namespace helicarm::operation
