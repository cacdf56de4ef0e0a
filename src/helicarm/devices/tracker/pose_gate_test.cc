// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/pose_gate.h"

#include <limits>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace pose_gate_test {

/// A marker at rest, measured at 50 Hz with the jitter of a tracker.
class Scene {
 public:
  Eigen::Matrix4d jittered() {
    const auto noise = [&]() -> Eigen::Vector3d {
      return 0.05 * Eigen::Vector3d(random_.normal(), random_.normal(), random_.normal());
    };
    return geometry::RigidTransform{
        geometry::rotation_from_vector(Eigen::Vector3d(0.3, 0.2, 1) + 1e-3 * noise()), place + noise()}
        .matrix();
  }
  /// Passes the next pose, stamped by the device.
  std::string next(const std::optional<Eigen::Matrix4d>& matrix = {}, bool visible = true) {
    now += 0.02;
    const auto passed = gate.pass({matrix ? *matrix : jittered(), now + device_ahead, now + delay, visible});
    if (passed) last = *passed;
    return passed ? "passed" : std::string(code(passed.error()));
  }
  /// Number of rejected poses among the next `count`.
  int rejected_of(int count) {
    int rejected = 0;
    for (int i = 0; i < count; ++i) rejected += next() != "passed";
    return rejected;
  }

  PoseGate gate;
  PoseSample last;
  Eigen::Vector3d place{100, -50, 900};
  double now = 1000;
  double device_ahead = 1.8e9;
  double delay = 0.005;

 private:
  RandomStream random_{11, 0};
};

TEST(PoseGate, PosesOfAMarkerAtRestAreAccepted) {
  Scene scene;
  EXPECT_EQ(scene.rejected_of(500), 0);
  EXPECT_TRUE(scene.gate.rejected().empty());
}

TEST(PoseGate, RoundingIsCorrected) {
  Eigen::Matrix4d rounded = Scene().jittered();
  rounded.topLeftCorner<3, 3>() = (rounded.topLeftCorner<3, 3>() * 1e4).array().round() / 1e4;
  const auto pose = rigid_pose(rounded, 3000);
  ASSERT_TRUE(pose);
  EXPECT_LT((pose->rotation.transpose() * pose->rotation - Eigen::Matrix3d::Identity()).norm(), 1e-14);
}

TEST(PoseGate, InvalidPoseIsReportedByItsFault) {
  Scene scene;
  const auto changed = [&](auto change) {
    Eigen::Matrix4d matrix = scene.jittered();
    change(matrix);
    return scene.next(matrix);
  };
  using M = Eigen::Matrix4d;
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(changed([](M& m) { m(0, 0) = nan; }), "not_finite");
  EXPECT_EQ(changed([](M& m) { m(2, 3) = infinity; }), "not_finite");
  EXPECT_EQ(changed([](M& m) { m.setZero(); }), "all_zero");
  EXPECT_EQ(changed([](M& m) { m.setIdentity(); }), "identity");
  EXPECT_EQ(changed([](M& m) { m.col(0) *= -1; }), "mirrored");
  EXPECT_EQ(changed([](M& m) { m.topLeftCorner<3, 3>() *= 1.01; }), "scaled");
  EXPECT_EQ(changed([](M& m) { m(0, 0) += 0.01; }), "not_rigid");
  EXPECT_EQ(changed([](M& m) { m(3, 0) = 1; }), "not_rigid");
  EXPECT_EQ(changed([](M& m) { m(2, 3) = 900e3; }), "out_of_volume");
  EXPECT_EQ(changed([](M&) {}), "passed");
  EXPECT_EQ(scene.next({}, false), "hidden");
  EXPECT_EQ(scene.gate.rejected().at("not_finite"), 2u);
}

TEST(PoseGate, FrozenPoseIsRejectedUntilItChanges) {
  Scene scene;
  const Eigen::Matrix4d same = scene.jittered();
  for (int i = 0; i < 26; ++i) EXPECT_EQ(scene.next(same), "passed");
  for (int i = 0; i < 20; ++i) EXPECT_EQ(scene.next(same), "frozen");
  EXPECT_EQ(scene.next(), "passed");
}

TEST(PoseGate, SingleOutlierIsRejected) {
  Scene scene;
  scene.rejected_of(10);
  Eigen::Matrix4d off = scene.jittered(), turned = scene.jittered();
  off(0, 3) += 50;
  turned.topLeftCorner<3, 3>() *= geometry::rotation_from_vector({0.3, 0, 0});
  EXPECT_EQ(scene.next(off), "jump");
  EXPECT_EQ(scene.next(), "passed");
  EXPECT_EQ(scene.next(turned), "jump");
  EXPECT_EQ(scene.rejected_of(100), 0);
}

TEST(PoseGate, NewPositionIsAcceptedWhenItPersists) {
  for (const double distance : {30.0, 200.0}) {
    Scene scene;
    scene.rejected_of(10);
    scene.place.x() += distance;
    const int rejected = scene.rejected_of(100);
    EXPECT_NEAR(rejected, 0.5 / 0.02, 1);
    EXPECT_EQ(scene.gate.rejected().at("jump"), static_cast<unsigned>(rejected));
  }
}

TEST(PoseGate, ThirdPoseAtANewPositionIsReportedBeforeItIsAccepted) {
  Scene scene;
  scene.rejected_of(10);
  scene.place.x() += 40;
  for (int i = 1; i <= 3; ++i) {
    EXPECT_EQ(scene.next(), "jump");
    EXPECT_EQ(scene.gate.elsewhere().has_value(), i == 3);
  }
  EXPECT_NEAR(scene.gate.elsewhere()->tracker_from_tool.translation.x(), scene.place.x(), 0.3);
  scene.place.x() -= 40;
  EXPECT_EQ(scene.next(), "passed");
  EXPECT_FALSE(scene.gate.elsewhere());
}

TEST(PoseGate, HandMotionIsAccepted) {
  Scene scene;
  for (int i = 0; i < 200; ++i) {
    scene.place.x() += 8;  // 0.4 m/s
    EXPECT_EQ(scene.next(), "passed");
  }
}

TEST(DeviceClock, TimeIsThatOfTheMeasurementOnTheLocalClock) {
  Scene scene;
  RandomStream random(3, 0);
  for (int i = 0; i < 300; ++i) {
    scene.delay = 0.002 + 0.03 * random.uniform();
    ASSERT_EQ(scene.next(), "passed");
    if (i > 50) {
      EXPECT_NEAR(scene.last.time_s, scene.now + 0.003, 0.002);
    }
  }
}

TEST(DeviceClock, EqualAndBackwardStampsAreRejected) {
  DeviceClock clock;
  EXPECT_TRUE(clock.local(100, 1));
  EXPECT_EQ(clock.local(100, 1.1).error(), PoseFault::time_equal);
  EXPECT_EQ(clock.local(99.9, 1.1).error(), PoseFault::time_back);
  EXPECT_TRUE(clock.local(100.1, 1.2));
}

TEST(DeviceClock, SingleStampAnHourOffIsRejected) {
  DeviceClock clock;
  EXPECT_TRUE(clock.local(10000, 1));
  EXPECT_EQ(clock.local(13600, 1.02).error(), PoseFault::time_jump);
  EXPECT_TRUE(clock.local(10000.04, 1.04));
  EXPECT_EQ(clock.local(6400, 1.06).error(), PoseFault::time_back);
  EXPECT_TRUE(clock.local(10000.08, 1.08));
}

TEST(DeviceClock, NewTimeBaseIsAcceptedWhenItPersistsForASecond) {
  for (const double step : {3600.0, -3600.0}) {
    Scene scene;
    EXPECT_EQ(scene.rejected_of(50), 0);
    scene.device_ahead += step;
    EXPECT_NEAR(scene.rejected_of(200), 1 / 0.02, 2);
    EXPECT_NEAR(scene.last.time_s, scene.now + scene.delay, 1e-3);
  }
}

TEST(DeviceClock, DelayedPosesGiveNoNewTimeBase) {
  DeviceClock clock;
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(clock.local(100 + 0.02 * i, 1 + 0.02 * i));
  for (int i = 50; i < 100; ++i) {
    const auto time = clock.local(100 + 0.02 * i, 3);  // delayed for up to a second, then all at once
    if (3 - (1 + 0.02 * i) > 0.51) {
      EXPECT_EQ(time.error(), PoseFault::late);
    }
  }
  EXPECT_NEAR(*clock.local(102.02, 3.02), 3.02, 1e-3);
}

TEST(DeviceClock, LatePosesStayLateUntilTheyCatchUp) {
  Scene scene;
  EXPECT_EQ(scene.rejected_of(50), 0);
  scene.delay += 0.8;
  EXPECT_EQ(scene.rejected_of(1000), 1000);
  EXPECT_EQ(scene.gate.rejected().at("late"), 1000u);
  scene.delay -= 0.8;
  EXPECT_EQ(scene.next(), "passed");
  EXPECT_NEAR(scene.last.time_s, scene.now + scene.delay, 1e-3);
}

TEST(DeviceClock, DelayIsNoDriftThoughItLasts) {
  Scene scene;
  scene.rejected_of(50);
  const double least = scene.delay;
  scene.delay += 0.3;
  EXPECT_EQ(scene.rejected_of(200000), 0);  // more than an hour
  EXPECT_NEAR(scene.last.time_s, scene.now + least, 2e-3);
}

TEST(DeviceClock, DriftIsFollowed) {
  DeviceClock clock;
  for (int i = 0; i < 200000; ++i) {
    const double now = 0.02 * i, time = *clock.local(1000 + now * (1 - 50e-6), now + 0.005);
    ASSERT_NEAR(time, now + 0.005, 1e-4);
  }
}

TEST(DeviceClock, ClockSetByLessThanHalfASecondDoesNotChangeTheAge) {
  for (const double step : {-0.1, -0.3, -0.45, 0.3}) {
    Scene scene;
    scene.rejected_of(100);
    scene.device_ahead += step;
    EXPECT_LE(scene.rejected_of(100), 1 / 0.02 + 2) << step;
    EXPECT_EQ(scene.rejected_of(100), 0) << step;
    EXPECT_NEAR(scene.last.time_s, scene.now + scene.delay, 1e-3) << step;
  }
}

TEST(DeviceClock, ClockSetWhileTheMarkerIsHiddenIsFollowed) {
  Scene scene;
  scene.rejected_of(100);
  for (int i = 0; i < 250; ++i) {
    if (i == 100) scene.device_ahead -= 2;
    scene.next({}, false);
  }
  EXPECT_EQ(scene.rejected_of(100), 0);
  EXPECT_NEAR(scene.last.time_s, scene.now + scene.delay, 1e-3);
}

TEST(DeviceClock, DelayOutlastsASettingOfTheClock) {
  for (const double step : {-1.0, -3600.0, 3600.0}) {
    Scene scene;
    scene.rejected_of(100);
    scene.delay += 0.8;
    scene.rejected_of(200);
    scene.device_ahead += step;
    EXPECT_EQ(scene.rejected_of(500), 500) << step;
    scene.delay -= 0.8;
    scene.next();
    EXPECT_NEAR(scene.last.time_s, scene.now + scene.delay, 1e-3) << step;
  }
}

TEST(DeviceClock, MessagesLostInAStallAreNoSettingOfTheClock) {
  DeviceClock clock;
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(clock.local(100 + 0.02 * i, 1 + 0.02 * i));
  for (int i = 50; i < 60; ++i) EXPECT_EQ(clock.local(100 + 0.02 * i, 4).error(), PoseFault::late);
  for (int i = 148; i < 151; ++i) EXPECT_TRUE(clock.local(100 + 0.02 * i, 4));
  EXPECT_NEAR(*clock.local(103.02, 4.02), 4.02, 1e-3);
}

TEST(DeviceClock, WithoutStampsTheArrivalTimeIsUsed) {
  DeviceClock clock;
  EXPECT_EQ(clock.local(0, 5), 5);
  EXPECT_GT(*clock.local(0, 5), 5);
  EXPECT_EQ(clock.local(0, 6), 6);
}

TEST(DeviceClock, TimesIncreaseWhenTheDelayShrinks) {
  DeviceClock clock;
  double last = *clock.local(100, 1.4);
  for (int i = 1; i < 20; ++i) {
    const double time = *clock.local(100 + 0.001 * i, 1.4 - 0.01 * i);
    EXPECT_GT(time, last);
    last = time;
  }
}

}  // namespace pose_gate_test
}  // namespace helicarm::tracker
