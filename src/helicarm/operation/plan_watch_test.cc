// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/plan_watch.h"

#include <functional>
#include <numbers>

#include <gmock/gmock.h>

#include "helicarm/core/random.h"
#include "helicarm/devices/robot/robot_scene_test.h"
#include "helicarm/devices/robot/script.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/operation/hand_eye_test.h"
#include "helicarm/virtual_devices/robot/virtual_controller.h"

namespace helicarm::operation {
namespace plan_watch_test {

using Eigen::Vector3d;
using testing::HasSubstr;

constexpr double rad = std::numbers::pi / 180;
constexpr double period_s = 0.008;  ///< state period of a CB3
constexpr const char* base_or_tool = "robot base or tool moved";

geometry::RigidTransform shift(double x, double y, double z) {
  return {Eigen::Matrix3d::Identity(), {x, y, z}};
}

geometry::RigidTransform turn_about(const Vector3d& point, const Vector3d& turn) {
  const Eigen::Matrix3d rotation = geometry::rotation_from_vector(turn);
  return {rotation, point - rotation * point};
}

/// Outcome of an order during a fault.
struct Outcome {
  std::optional<Failure> stopped;
  double rest_s = 0;        ///< from the true motion exceeding its limit until the arm rests
  double error_mm = 0;      ///< true motion at rest
  double travelled_mm = 0;  ///< path of the tip since then
};

/// Robot, tracker and bone on one virtual clock. Motions are along the tracker's axes, functions of the time
/// since the order began.
struct Scene {
  using Moves = std::function<geometry::RigidTransform(double)>;

  explicit Scene(double rate_hz = 60, std::uint64_t seed = 1)
      : tracker_period_s(1 / rate_hz),
        random(seed, 0),
        robot(robot::ur5(), robot::drill(), robot::resting_joints()) {
    const robot::TunnelAxis tunnel = robot::knee_tunnel();
    const Vector3d start = hand_eye.tracker_from_base * tunnel.start_in_base;
    tracker_from_femur = {geometry::rotation_from_euler(0.4, -0.3, 1.2), start + Vector3d(70, -60, 80)};
    for (const Vector3d& end : {tunnel.start_in_base, tunnel.end_in_base})
      points_in_femur.push_back(tracker_from_femur.inverse() * (hand_eye.tracker_from_base * end));
    for (int i = 0; i < 100; ++i) step();  // the gate accepts both markers
  }

  PlanWatch watch() const {
    const geometry::RigidTransform from_tcp =
        hand_eye.flange_from_marker.inverse() * robot::drill().flange_from_tcp;
    return {PlanLimits(), TrackerPlan(),
            PlanBasis{time_s, "femur", tracker_from_femur, points_in_femur, from_tcp,
                      hand_eye.tracker_from_base, robot.state().base_from_tcp}};
  }

  geometry::RigidTransform tip() const {
    return base_moves * hand_eye.tracker_from_base * robot.state().base_from_tcp;
  }
  double moved_mm() const {
    double most = 0;
    for (const Vector3d& point : points_in_femur) {
      const Vector3d at = tracker_from_femur * point;
      most = std::max(most, (femur_moves * at - at).norm());
    }
    return std::max(most,
                    ((base_moves * tool_moves).inverse() * tip().translation - tip().translation).norm());
  }
  bool astray() const {
    const auto turn = [](const geometry::RigidTransform& moves) {
      return geometry::vector_from_rotation(moves.rotation).norm();
    };
    const PlanLimits limits;
    return moved_mm() > limits.distance_mm ||
           std::max({turn(femur_moves), turn(base_moves), turn(tool_moves)}) > limits.turn_deg * rad;
  }

  geometry::RigidTransform seen(const geometry::RigidTransform& truth) {
    const auto noise = [&](double sigma) {
      return Vector3d(sigma * Vector3d(random.normal(), random.normal(), random.normal()));
    };
    return {geometry::rotation_from_vector(noise(sigma_deg * rad)) * truth.rotation,
            truth.translation + noise(sigma_mm)};
  }

  void step() {
    robot.step();
    time_s += period_s;
    track.take(time_s, robot.state().base_from_tcp, time_s + 0.001);
    if (time_s < next_sample_s) return;
    next_sample_s += tracker_period_s;
    // A slip of the tool in its mount moves the marker as a base motion would.
    const geometry::RigidTransform marker =
        base_moves * tool_moves * hand_eye.tracker_from_base * robot.state().base_from_tcp *
        robot::drill().flange_from_tcp.inverse() * hand_eye.flange_from_marker;
    const geometry::RigidTransform femur = femur_moves * tracker_from_femur;
    if (++samples % one_kept_in) return;
    board.take({"tracker", tracker::stamp_from_seconds(1.7e9 + time_s),
                tracker::IgtlTracking{{{"femur", 1, seen(taken_for_femur.value_or(femur)).matrix()},
                                       {"tool", 1, seen(marker).matrix()}}}},
               time_s + delay_s);
  }

  /// Until the order is stopped or done.
  Outcome carry_out(const robot::RobotOrder& order, const Moves& femur, const Moves& base = {},
                    const Moves& tool = {}) {
    const PlanWatch plan = watch();
    constexpr robot::OrderNumber number{7, 1};
    robot.run_script(robot::script_of(order, robot::ur5(), number));
    const double begun_s = time_s;
    Outcome outcome;
    std::optional<double> astray_s;
    Vector3d tip_then = tip().translation;
    for (int period = 0; period < 20000; ++period) {
      const double since_s = time_s - begun_s;
      if (femur) femur_moves = femur(since_s);
      if (base) base_moves = base(since_s);
      if (tool) tool_moves = tool(since_s);
      if (!astray_s && astray()) astray_s = time_s, tip_then = tip().translation;
      const robot::ScriptReport script = robot.state().script;
      const bool may_move = !outcome.stopped && script.order == number && script.tick > 0;
      robot.set_heartbeat({may_move ? script.tick : robot::stop_beat, number});
      step();
      if (robot.state().runtime == robot::RuntimeState::stopped && !robot.moving()) break;
      if (outcome.stopped) continue;
      if (const auto holds = plan.in_place(board, track, time_s); !holds) outcome.stopped = holds.error();
    }
    outcome.rest_s = outcome.stopped ? time_s - astray_s.value_or(time_s) : 0;
    outcome.error_mm = moved_mm();
    outcome.travelled_mm =
        (base_moves.inverse() * tip().translation - base_moves.inverse() * tip_then).norm();
    return outcome;
  }

  void next_sample() {
    for (const double before_s = next_sample_s; next_sample_s == before_s;) step();
  }
  void pass(double seconds) {
    for (const double until_s = time_s + seconds; time_s < until_s;) step();
  }

  double tracker_period_s;
  double delay_s = 0.002;
  int samples = 0, one_kept_in = 1;  ///< the others are lost
  double sigma_mm = 0.12, sigma_deg = 0.05;
  RandomStream random;
  double time_s = 0, next_sample_s = 0;
  tracker::HandEye hand_eye = exact_hand_eye();
  robot::VirtualController robot;
  tracker::PoseBoard board;
  robot::ToolTrack track;
  geometry::RigidTransform tracker_from_femur;
  std::vector<Vector3d> points_in_femur;
  geometry::RigidTransform femur_moves, base_moves, tool_moves;
  std::optional<geometry::RigidTransform> taken_for_femur;
};

/// While the tool moves along the axis.
constexpr double on_the_axis_s = 4;

geometry::RigidTransform still(double) { return {}; }

Scene::Moves from(double begin_s, const Scene::Moves& moves) {
  return [=](double t) { return t < begin_s ? geometry::RigidTransform() : moves(t - begin_s); };
}

void expect_stop(const Outcome& outcome, const char* what, double longest_s) {
  if (!outcome.stopped) FAIL() << "the order was not stopped";
  EXPECT_EQ(outcome.stopped->reason, Reason::plan_stale) << outcome.stopped->message;
  EXPECT_THAT(outcome.stopped->message, HasSubstr(what));
  EXPECT_TRUE(outcome.stopped->figures.at("distance_mm") > 1 || outcome.stopped->figures.at("turn_deg") > 1);
  EXPECT_LT(outcome.rest_s, longest_s);
  testing::Test::RecordProperty("ms_to_rest", int(outcome.rest_s * 1000));
  testing::Test::RecordProperty("moved_um", int(outcome.error_mm * 1000));
  testing::Test::RecordProperty("tool_um", int(outcome.travelled_mm * 1000));
}

TEST(PlanWatch, OrderWithoutMotionIsCarriedOutDespiteNoise) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    Scene scene(seed % 2 ? 60 : 20, seed);
    const Outcome outcome = scene.carry_out(robot::planned(), still);
    EXPECT_FALSE(outcome.stopped) << outcome.stopped->message;
  }
}

TEST(PlanWatch, TenMinutesOfNoiseStayBelowTheLimit) {
  Scene scene;
  const PlanWatch watch = scene.watch();
  double most_mm = 0, most_deg = 0;
  while (scene.time_s < 600) {
    scene.next_sample();
    for (const auto& moved : {watch.bone_motion(scene.board, scene.time_s),
                              watch.base_motion(scene.board, scene.track, scene.time_s)}) {
      most_mm = std::max(most_mm, moved.value().distance_mm);
      most_deg = std::max(most_deg, moved.value().turn_deg);
    }
  }
  EXPECT_LT(most_mm, 0.8);
  EXPECT_LT(most_deg, 0.3);
  RecordProperty("most_um", int(most_mm * 1000));
  RecordProperty("most_mdeg", int(most_deg * 1000));
}

/// Most that ten minutes of this scene's noise at rest appear as a motion of base or tool, mm.
double most_at_rest_mm(Scene& scene) {
  const PlanWatch watch = scene.watch();
  double most_mm = 0;
  while (scene.time_s < 600) {
    scene.next_sample();
    const auto moved = watch.base_motion(scene.board, scene.track, scene.time_s);
    most_mm = std::max(most_mm, moved.value().distance_mm);
  }
  testing::Test::RecordProperty("most_um", int(most_mm * 1000));
  return most_mm;
}

TEST(PlanWatch, TenMinutesOfRotationalNoiseOfTheToolStayBelowTheLimit) {
  Scene scene;
  scene.sigma_deg = 0.2;
  EXPECT_LT(most_at_rest_mm(scene), 1);
}

TEST(PlanWatch, LostSamplesDoNotRaiseTheNoise) {
  Scene scene;
  scene.sigma_deg = 0.2;
  scene.one_kept_in = 2;
  EXPECT_LT(most_at_rest_mm(scene), 1);
}

TEST(PlanWatch, CreepingBoneStopsTheRobot) {
  // Fifteen steps of 2 mm, as when someone shifts the leg.
  const Outcome creep = Scene().carry_out(robot::planned(), from(on_the_axis_s, [](double t) {
                                            return shift(2 * std::min(15.0, std::floor(6 * t)), 0, 0);
                                          }));
  expect_stop(creep, "femur moved", 0.2);
  EXPECT_LT(creep.error_mm, 5);
}

TEST(PlanWatch, SlowDriftStopsTheRobotAtTheLimit) {
  const Outcome drift =
      Scene().carry_out(robot::planned(), from(0.5, [](double t) { return shift(0, 0.5 * t, 0); }));
  expect_stop(drift, "femur moved", 0.5);
  EXPECT_LT(drift.error_mm, 1.3);
}

TEST(PlanWatch, JumpBeforeTheStandOffStopsTheRobot) {
  expect_stop(Scene().carry_out(robot::planned(), from(0.8, [](double) { return shift(0, 0, 3); })),
              "femur moved", 0.25);
}

TEST(PlanWatch, JumpOfTheBoneStopsTheRobotAtAnyTime) {
  Outcome worst;
  for (int i = 0; i < 6; ++i) {
    const Outcome jump = Scene(60, 1 + std::uint64_t(i))
                             .carry_out(robot::planned(), from(on_the_axis_s + 0.004 * i,
                                                               [](double) { return shift(2, 2, -1); }));
    expect_stop(jump, "femur moved", 0.2);
    if (jump.rest_s > worst.rest_s) worst = jump;
  }
  expect_stop(worst, "femur moved", 0.2);
}

TEST(PlanWatch, BoneThatRotatesAboutTheTunnelStopsTheRobot) {
  Scene scene;
  const Vector3d start = scene.tracker_from_femur * scene.points_in_femur.front();
  const Outcome turned = scene.carry_out(robot::planned(), from(on_the_axis_s, [&](double t) {
                                           return turn_about(start, {0, 0, std::min(3.0, 6 * t) * rad});
                                         }));
  expect_stop(turned, "femur moved", 0.3);
  EXPECT_GT(turned.stopped->figures.at("turn_deg"), 1);
}

TEST(PlanWatch, MovedBaseStopsTheRobot) {
  expect_stop(
      Scene().carry_out(robot::planned(), still, from(on_the_axis_s, [](double) { return shift(2, 2, 2); })),
      base_or_tool, 0.2);
}

TEST(PlanWatch, BaseThatCreepsStopsTheRobot) {
  const Outcome creep = Scene().carry_out(robot::planned(), still,
                                          from(on_the_axis_s, [](double t) { return shift(0, 12 * t, 0); }));
  expect_stop(creep, base_or_tool, 0.4);
}

TEST(PlanWatch, ToolThatSlipsInItsMountStopsTheRobot) {
  Scene scene;
  const auto slips = [&](double) { return turn_about(scene.tip().translation, {0.05, 0, 0}); };
  expect_stop(scene.carry_out(robot::planned(), still, {}, from(on_the_axis_s, slips)), base_or_tool, 0.2);
}

TEST(PlanWatch, BaseMotionBeforeTheOrderIsDetectedInEveryDirection) {
  for (const Vector3d& way : {Vector3d(3, 0, 0), Vector3d(0, 3, 0), Vector3d(0, 0, 3)}) {
    Scene scene;
    const PlanWatch watch = scene.watch();
    ASSERT_TRUE(watch.holds(scene.board, scene.track, scene.time_s));
    scene.base_moves = shift(way.x(), way.y(), way.z());
    scene.pass(0.2);
    const auto holds = watch.holds(scene.board, scene.track, scene.time_s);
    ASSERT_FALSE(holds);
    EXPECT_EQ(holds.error().reason, Reason::plan_stale);
    EXPECT_THAT(holds.error().message, HasSubstr(base_or_tool));
    EXPECT_NEAR(holds.error().figures.at("distance_mm"), 3, 0.5);
  }
}

TEST(PlanWatch, BoneMotionDuringAnOcclusionIsDetected) {
  Scene scene;
  const PlanWatch watch = scene.watch();
  scene.femur_moves = shift(40, 0, 0);
  scene.pass(1);  // until the gate accepts the new position
  const auto holds = watch.holds(scene.board, scene.track, scene.time_s);
  ASSERT_FALSE(holds);
  EXPECT_EQ(holds.error().reason, Reason::plan_stale);
  EXPECT_NEAR(holds.error().figures.at("distance_mm"), 40, 0.5);
}

TEST(PlanWatch, CalibratorTakenForTheBoneIsDetected) {
  Scene scene;
  const PlanWatch watch = scene.watch();
  scene.taken_for_femur = scene.tracker_from_femur * shift(150, -40, 20);
  scene.pass(0.1);
  const auto holds = watch.holds(scene.board, scene.track, scene.time_s);
  ASSERT_FALSE(holds);
  EXPECT_EQ(holds.error().reason, Reason::plan_stale);
  EXPECT_NEAR(holds.error().figures.at("distance_mm"), Vector3d(150, -40, 20).norm(), 1.5);
}

TEST(PlanWatch, JumpThatTheGateDoesNotAcceptYetStopsTheRobot) {
  const Outcome jump =
      Scene().carry_out(robot::planned(), from(on_the_axis_s, [](double) { return shift(40, 0, 0); }));
  expect_stop(jump, "femur moved", 0.2);
  EXPECT_NEAR(jump.stopped->figures.at("distance_mm"), 40, 1);
}

TEST(PlanWatch, OneOrTwoOutliersHaveNoEffect) {
  Scene scene;
  const PlanWatch watch = scene.watch();
  for (int outliers = 1; outliers <= 2; ++outliers) {
    for (int sample = 0; sample < outliers; ++sample) {
      scene.femur_moves = shift(4, 0, 0);
      scene.next_sample();
      EXPECT_TRUE(watch.holds(scene.board, scene.track, scene.time_s)) << outliers;
    }
    scene.femur_moves = {};
    scene.pass(0.2);
  }
}

TEST(PlanWatch, DelayedTrackerDoesNotStopAFastTool) {
  Scene scene;
  scene.delay_s = 0.06;
  robot::ApproachOptions fast;
  fast.travel_mm_s = 120;
  const Outcome outcome = scene.carry_out(robot::planned(fast), still);
  EXPECT_FALSE(outcome.stopped) << outcome.stopped->message;
}

TEST(PlanWatch, PlanExpiresByItsAge) {
  Scene scene;
  const PlanWatch watch = scene.watch();
  EXPECT_TRUE(watch.young(scene.time_s + 59.9));
  const auto old = watch.young(scene.time_s + 60.1);
  ASSERT_FALSE(old);
  EXPECT_EQ(old.error().reason, Reason::plan_stale);
  EXPECT_NEAR(old.error().figures.at("age_s"), 60.1, 1e-9);
}

TEST(PlanWatch, WithoutPosesOfTrackerOrRobotNoPlanHolds) {
  Scene scene;
  const PlanWatch watch = scene.watch();
  EXPECT_EQ(watch.in_place(scene.board, scene.track, scene.time_s + 0.2).error().reason, Reason::stale_pose);
  EXPECT_EQ(watch.in_place(tracker::PoseBoard(), scene.track, scene.time_s).error().reason, Reason::no_pose);
  EXPECT_EQ(watch.in_place(scene.board, robot::ToolTrack(), scene.time_s).error().reason,
            Reason::stale_state);
}

TEST(PlanWatch, KinematicErrorWidensTheBaseLimitsWithTravel) {
  const PlanLimits at_rest = widened({1, 1, 60}, {0, 0}), travelled = widened({1, 1, 60}, {200, 50});
  EXPECT_FALSE(check_motion("robot base or tool", {1.01, 0}, at_rest));
  EXPECT_TRUE(check_motion("robot base or tool", {1.99, 1.49}, travelled));
  EXPECT_FALSE(check_motion("robot base or tool", {2.01, 0}, travelled));
  EXPECT_FALSE(check_motion("robot base or tool", {0, 1.51}, travelled));
}

}  // namespace plan_watch_test
}  // namespace helicarm::operation
