// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/camera_errors.h"

#include <random>

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/track/track.h"
#include "helicarm/track/two_bodies_test.h"

namespace helicarm::track {
namespace camera_errors_test {

using namespace two_bodies_test;

constexpr int error_count = 5;

/// Errors of the cameras that leave no ray gap: the world's scale, by 0.5 %, its axes, by 0.003 rad each, and
/// their angle, the first camera turned alone: what that does to a place depends on where it is.
Eigen::MatrixXd errors_without_gaps(const TrackCase& the_case) {
  Eigen::MatrixXd errors = Eigen::MatrixXd::Zero(22, error_count);
  for (std::size_t k = 0; k < the_case.views.size(); ++k) {
    const geometry::RigidTransform& pose = the_case.views[k].camera.camera_from_world;
    errors.block<3, 3>(11 * Eigen::Index(k) + 4, 1) = 0.003 * pose.rotation;
    errors.block<3, 1>(11 * Eigen::Index(k) + 7, 0) = 0.005 * pose.translation;
  }
  errors.block<3, 1>(4, 4) = 0.003 * the_case.views[0].camera.camera_from_world.rotation.col(2);
  return errors;
}

/// Cameras displaced by these multiples of the errors.
TrackCase off_by(TrackCase the_case, const Eigen::VectorXd& sizes) {
  const Eigen::VectorXd off = errors_without_gaps(the_case) * sizes;
  for (std::size_t k = 0; k < the_case.views.size(); ++k) {
    geometry::RigidTransform& pose = the_case.views[k].camera.camera_from_world;
    const auto at = 11 * Eigen::Index(k);
    pose = {geometry::rotation_from_vector(off.segment<3>(at + 4)) * pose.rotation,
            pose.translation + off.segment<3>(at + 7)};
  }
  return the_case;
}

TrackCase with_errors(TrackCase the_case) {
  const Eigen::MatrixXd errors = errors_without_gaps(the_case);
  the_case.camera_covariance = errors * errors.transpose();
  return the_case;
}

TrackCase off_by_draw(const TrackCase& the_case, int seed) {
  std::mt19937 random(static_cast<unsigned>(seed));
  std::normal_distribution<double> normal;
  Eigen::VectorXd draw(error_count);
  for (double& value : draw) value = normal(random);
  return off_by(with_errors(the_case), draw);
}

/// The bodies' shapes, in coordinates of their own.
TrackCase with_geometry(TrackCase the_case, const geometry::RigidTransform& ct_from_body) {
  for (std::size_t b = 0; b < the_case.bodies.size(); ++b)
    for (const Eigen::Vector3d& marker : bodies[b])
      the_case.bodies[b].geometry.push_back(ct_from_body * marker);
  return the_case;
}

const geometry::RigidTransform far_away{geometry::rotation_from_vector({1.2, -0.4, 2.1}), {-120, 300, -700}};

/// The second body's are turned by 180 degrees about x: flexion is at the end of its range.
std::vector<BodyAxes> axes_of_both() {
  Eigen::Matrix3d turned;
  turned << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  return {{0, Eigen::Matrix3d::Identity(), Eigen::Vector3d(0, 0, 0)}, {1, turned, Eigen::Vector3d(5, 0, 0)}};
}

TEST(Sequence, SigmasDoNotDependOnTheCoordinatesOfTheGeometry) {
  TrackCase the_case = with_errors(two_bodies());
  the_case.axes = axes_of_both();
  const auto sights = drawn(the_case, none);
  const Sequence near = estimate_sequence(with_geometry(the_case, {}), sights),
                 far = estimate_sequence(with_geometry(the_case, far_away), sights);
  const auto expect_same = [](const TrackedBody& one, const TrackedBody& other) {
    EXPECT_TRUE(one.pose->pose.matrix().isApprox(other.pose->pose.matrix(), 1e-6));
    EXPECT_TRUE(one.pose->covariance.isApprox(other.pose->covariance, 1e-4));
  };
  for (std::size_t b = 0; b < 2; ++b) {
    expect_same(near.bodies[b].frames.back(), far.bodies[b].frames.back());
    expect_same(near.bodies[b].smoothed.back(), far.bodies[b].smoothed.back());
  }
  expect_same(near.relative[0].back(), far.relative[0].back());
  const auto &near_joint = near.joints[0].frames.back(), &far_joint = far.joints[0].frames.back();
  EXPECT_TRUE(near_joint->covariance.isApprox(far_joint->covariance, 1e-4));
  EXPECT_TRUE(near_joint->shift_covariance.isApprox(far_joint->shift_covariance, 1e-4));
}

TEST(Sequence, SigmaOfAnAngleAtTheEndOfItsRangeIsThatOfAnother) {
  TrackCase the_case = with_errors(two_bodies());
  const auto sights = drawn(the_case, none);
  the_case.axes = axes_of_both();
  const Sequence at_end = estimate_sequence(the_case, sights);
  the_case.axes[1].axes.setIdentity();
  const Sequence beside_zero = estimate_sequence(the_case, sights);
  for (std::size_t f = 1; f < sights.size(); ++f)
    EXPECT_NEAR(at_end.joints[0].frames[f]->covariance(0, 0),
                beside_zero.joints[0].frames[f]->covariance(0, 0), 1e-8)
        << f;
}

/// What a displacement of the cameras by a standard deviation of each of their errors does to the last pose
/// of the first body. Smaller ones drown in where the robust weights of a given geometry change.
registration::RigidCovariance spread_by_cameras(const TrackCase& exact,
                                                const std::vector<FrameSights>& sights) {
  registration::RigidCovariance spread = registration::RigidCovariance::Zero();
  for (int i = 0; i < error_count; ++i) {
    const auto last = [&](double size) {
      const TrackCase displaced = off_by(exact, size * Eigen::VectorXd::Unit(error_count, i));
      return estimate_sequence(displaced, sights).bodies[0].smoothed.back();
    };
    const TrackedBody up = last(1), down = last(-1);
    const registration::RigidStep step =
        registration::step_about(up.pose->pose, down.pose->pose, up.centre) / 2;
    spread += step * step.transpose();
  }
  return spread;
}

TEST(Sequence, CamerasAddWhatTheirDisplacementDoesToAPose) {
  auto sights = drawn(two_bodies(), none);
  sights.resize(20);
  for (const TrackCase& exact : {two_bodies(), with_geometry(two_bodies(), far_away)}) {
    const auto covariance = [&](const TrackCase& the_case) {
      return estimate_sequence(the_case, sights).bodies[0].smoothed.back().pose->covariance;
    };
    const Eigen::VectorXd added = (covariance(with_errors(exact)) - covariance(exact)).diagonal(),
                          spread = spread_by_cameras(exact, sights).diagonal();
    EXPECT_NEAR(added.head(3).sum() / spread.head(3).sum(), 1, 0.1);
    EXPECT_NEAR(added.tail(3).sum() / spread.tail(3).sum(), 1, 0.1);
  }
}

TEST(Sequence, MarkerIsPlacedWhereItWasInTheFirstFrame) {
  constexpr std::size_t late = 3;  // of the jaw
  for (const TrackCase& the_case : {two_bodies(), with_geometry(two_bodies(), far_away)}) {
    auto sights = drawn(the_case, none);
    for (std::size_t f = 0; f < 25; ++f) sights[f].of[late].assign(2, std::nullopt);
    const Sequence sequence = estimate_sequence(the_case, sights);
    for (std::size_t i = 0; i < 4; ++i) {
      const auto& placed = sequence.bodies[0].markers[i].in_body;
      ASSERT_TRUE(placed);
      EXPECT_LT((placed->place - place_of(i, 1, none)).norm(), 0.2) << i;
    }
  }
}

TEST(Sequence, MarkerThatIsNeverSeenHasNoPlaceAndCountsNowhere) {
  constexpr std::size_t never = 3;  // of the jaw
  TrackCase the_case = with_errors(two_bodies());
  auto sights = drawn(the_case, none);
  for (FrameSights& frame : sights) frame.of[never].assign(2, std::nullopt);
  const Sequence sequence = estimate_sequence(the_case, sights);
  EXPECT_FALSE(sequence.bodies[0].markers[never].in_body);
  const Json marker = to_json(sequence, the_case)["bodies"][0]["markers"][never];
  EXPECT_TRUE(marker["in_body_mm"].is_null());
  EXPECT_TRUE(marker["covariance_mm2"].is_null());
  std::erase(the_case.bodies[0].markers, never);
  const Sequence without = estimate_sequence(the_case, sights);
  EXPECT_TRUE(sequence.bodies[0].smoothed.back().pose->covariance.isApprox(
      without.bodies[0].smoothed.back().pose->covariance, 1e-9));
}

TEST(Sequence, ErrorsOfTheCamerasAreInTheBandsOfMotion) {
  constexpr double chi2_at_95 = 12.59;  // six degrees of freedom
  constexpr int draws = 40;
  const auto sights = drawn(two_bodies(), none);
  int inside = 0, inside_as_exact = 0, inside_between = 0;
  for (int seed = 0; seed < draws; ++seed) {
    TrackCase the_case = off_by_draw(two_bodies(), seed);
    const Sequence sequence = estimate_sequence(the_case, sights);
    the_case.camera_covariance.resize(0, 0);
    const Sequence as_exact = estimate_sequence(the_case, sights);
    const auto chi2 = [](const TrackedBody& body, const geometry::RigidTransform& truth) {
      const registration::RigidStep off = registration::step_about(body.pose->pose, truth, body.centre);
      return off.dot(body.pose->covariance.ldlt().solve(off));
    };
    const geometry::RigidTransform jaw = pose_at(0, frames) * pose_at(0, 1).inverse(),
                                   skull = pose_at(1, frames) * pose_at(1, 1).inverse();
    inside += chi2(sequence.bodies[0].smoothed.back(), jaw) < chi2_at_95;
    inside_as_exact += chi2(as_exact.bodies[0].smoothed.back(), jaw) < chi2_at_95;
    inside_between += chi2(sequence.relative[0].back(), jaw.inverse() * skull) < chi2_at_95;
  }
  EXPECT_GE(inside, 35);
  EXPECT_GE(inside_between, 35);
  EXPECT_LT(inside_as_exact, 20);
}

}  // namespace camera_errors_test
}  // namespace helicarm::track
