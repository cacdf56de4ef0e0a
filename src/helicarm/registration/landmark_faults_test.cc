// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/landmark_faults.h"

#include <gmock/gmock.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::registration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using testing::HasSubstr;

const geometry::RigidTransform faulty_pose{geometry::rotation_from_vector({0.5, -1, 2}), {10, -20, 30}};

std::vector<Landmark> four_landmarks(double sigma_mm, double stated_mm, std::uint64_t trial = 0) {
  RandomStream random(1, 7, trial);
  std::vector<Landmark> all;
  const std::vector<Vector3d> places = {{22, -6, 4}, {-20, -10, -15}, {-3, 18, 12}, {8, 9, -20}};
  for (std::size_t i = 0; i < places.size(); ++i)
    all.push_back(
        {std::string(1, char('a' + int(i))), places[i],
         faulty_pose * places[i] + sigma_mm * Vector3d(random.normal(), random.normal(), random.normal()),
         stated_mm * stated_mm * Matrix3d::Identity()});
  return all;
}

std::optional<LandmarkFault> fault_of(const std::vector<Landmark>& landmarks) {
  return landmark_fault(landmarks, *register_landmarks(landmarks));
}

TEST(LandmarkFaults, ExchangedNamesAreNamed) {
  auto landmarks = four_landmarks(0.05, 0.06);
  std::swap(landmarks[0].in_world, landmarks[1].in_world);
  const auto fault = fault_of(landmarks);
  ASSERT_TRUE(fault);
  EXPECT_TRUE(fault->is_certain);
  EXPECT_EQ(fault->failure.reason, Reason::residual_too_large);
  EXPECT_THAT(fault->failure.message, HasSubstr("\"a\" and \"b\" exchanged"));
}

TEST(LandmarkFaults, ExchangedNamesOfPointsPlacedByHandAreNamed) {
  auto landmarks = four_landmarks(1.5, 0.06);
  std::swap(landmarks[2].in_world, landmarks[3].in_world);
  const auto fault = fault_of(landmarks);
  ASSERT_TRUE(fault && fault->is_certain);
  EXPECT_THAT(fault->failure.message, HasSubstr("\"c\" and \"d\" exchanged"));
}

TEST(LandmarkFaults, ThreeNamesInAnotherOrderAreNamed) {
  auto landmarks = four_landmarks(0.05, 0.06);
  std::swap(landmarks[0].in_world, landmarks[1].in_world);
  std::swap(landmarks[1].in_world, landmarks[2].in_world);
  const auto fault = fault_of(landmarks);
  ASSERT_TRUE(fault && fault->is_certain);
  EXPECT_THAT(fault->failure.message, HasSubstr("in the place of"));
}

TEST(LandmarkFaults, AMirrorImageIsNamed) {
  auto landmarks = four_landmarks(0.05, 0.06);
  for (Landmark& landmark : landmarks) landmark.in_model.y() *= -1;
  const auto fault = fault_of(landmarks);
  ASSERT_TRUE(fault && fault->is_certain);
  EXPECT_THAT(fault->failure.message, HasSubstr("mirror image"));
}

TEST(LandmarkFaults, AnotherUnitIsNamed) {
  auto landmarks = four_landmarks(0.05, 0.06);
  for (Landmark& landmark : landmarks) landmark.in_model *= 10;
  const auto fault = fault_of(landmarks);
  ASSERT_TRUE(fault && fault->is_certain);
  EXPECT_THAT(fault->failure.message, HasSubstr("in tenths of a mm"));
}

TEST(LandmarkFaults, CentimetresThatLeaveTheLandmarksNearALineAreAskedFor) {
  auto landmarks = four_landmarks(0.05, 0.06);
  for (Landmark& landmark : landmarks) landmark.in_model /= 10;
  const auto found = register_landmarks(landmarks);
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().message, HasSubstr("in cm?"));
}

TEST(LandmarkFaults, OneWrongLandmarkIsNotCertain) {
  auto landmarks = four_landmarks(0.05, 0.06);
  landmarks[2].in_world += Vector3d(25, -20, 10);
  const auto fault = fault_of(landmarks);
  ASSERT_TRUE(fault);
  EXPECT_FALSE(fault->is_certain) << fault->failure.message;
}

TEST(LandmarkFaults, PlacingErrorsAreNoFault) {
  for (std::uint64_t trial = 0; trial < 300; ++trial) {
    const auto fault = fault_of(four_landmarks(1.2, 0.06, trial));
    EXPECT_FALSE(fault && fault->is_certain) << fault->failure.message;
  }
  EXPECT_FALSE(fault_of(four_landmarks(0, 0)));
}

std::optional<LandmarkFault> contradiction_at(double shift_mm) {
  const auto landmarks = four_landmarks(0.05, 0.06);
  auto pose = faulty_pose;
  pose.translation.x() += shift_mm;
  return contradiction(landmarks, *register_landmarks(landmarks), pose, 1e-4 * RigidCovariance::Identity(),
                       pose.translation);
}

TEST(LandmarkFaults, APoseFromImagesIsComparedWithThem) {
  EXPECT_FALSE(contradiction_at(2));
  const auto five = contradiction_at(5);
  ASSERT_TRUE(five);
  EXPECT_EQ(five->failure.reason, Reason::registration_disagrees);
  EXPECT_FALSE(five->is_certain);
  EXPECT_NEAR(five->failure.figures.at("distance_mm"), 5, 0.2);
  EXPECT_TRUE(contradiction_at(15)->is_certain);
}

TEST(LandmarkFaults, ThreeHaveNoHandedness) {
  auto landmarks = four_landmarks(0.05, 0.06);
  EXPECT_FALSE(handedness_note(landmarks, *register_landmarks(landmarks), {}));
  landmarks.pop_back();
  const auto note = handedness_note(landmarks, *register_landmarks(landmarks), {Vector3d(0, 0, -40)});
  ASSERT_TRUE(note);
  EXPECT_EQ(note->reason, Reason::ambiguous_handedness);
  EXPECT_GT(note->figures.at("moved_mm"), 30);
}

TEST(LandmarkFaults, FourInAPlaneHaveNoHandedness) {
  auto landmarks = four_landmarks(0.05, 0.06);
  landmarks[3].in_model =
      0.4 * landmarks[0].in_model + 0.8 * landmarks[1].in_model - 0.2 * landmarks[2].in_model;
  landmarks[3].in_world = faulty_pose * landmarks[3].in_model;
  EXPECT_TRUE(handedness_note(landmarks, *register_landmarks(landmarks), {}));
}

}  // namespace
}  // namespace helicarm::registration
