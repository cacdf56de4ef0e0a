// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/measured_object.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::case_registration {
namespace measured_object_test {

using testing::HasSubstr;

Measurement measured() {
  Measurement measured;
  measured.result.points.emplace_back().name = "lost";
  pipeline::PointResult& located = measured.result.points.emplace_back();
  located.name = "FS";
  located.place.emplace().in_calibrator = {1, 2, 3};
  for (const char* model : {"femur", "tibia"})
    measured.result.model_points.push_back({model, "entry", {{4, 5, 6}}});
  registration::Registration& femur = measured.registration.emplace().models.emplace_back().registration;
  femur.name = "femur";
  femur.centre = {7, 8, 9};
  femur.covariance.setIdentity();
  femur.covariance(5, 5) = 0.25;
  return measured;
}

TEST(MeasuredObject, IsALocatedPoint) {
  EXPECT_EQ(object_named(measured(), "FS")->at, Eigen::Vector3d(1, 2, 3));
}

TEST(MeasuredObject, IsAModelsCentre) {
  const auto femur = object_named(measured(), "femur");
  ASSERT_TRUE(femur) << femur.error().message;
  EXPECT_EQ(femur->at, Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(femur->covariance(2, 2), 0.25);
}

TEST(MeasuredObject, APlannedPointIsNamedWithItsModelWhereTwoHaveIt) {
  EXPECT_EQ(object_named(measured(), "entry").error().reason, Reason::name_clash);
  EXPECT_EQ(object_named(measured(), "tibia: entry")->at, Eigen::Vector3d(4, 5, 6));
}

TEST(MeasuredObject, OfATrackedBoneHasItsMotionUpToEachView) {
  Measurement of = measured();
  of.result.points[1].moves_with = "tibia";
  of.registration->models[0].moves_with = "femur";
  for (const double moved : {0.0, 30.0}) {
    guidance::Poses& poses = of.poses.emplace_back();
    poses.tracker_from_calibrator = geometry::RigidTransform{};
    poses.tracker_from_bone["femur"] = {Eigen::Matrix3d::Identity(), {100, moved, 0}};
  }
  for (const char* name : {"femur", "femur: entry"}) {
    const auto object = object_named(of, name);
    ASSERT_TRUE(object) << object.error().message;
    ASSERT_EQ(object->motions.size(), 2U) << name;
    EXPECT_EQ(object->motions[0] * object->at, object->at);
    EXPECT_EQ(object->motions[1] * object->at, object->at + Eigen::Vector3d(0, 30, 0));
  }
  // The tibia has no marker: it is taken as fixed.
  EXPECT_TRUE(object_named(of, "FS")->motions.empty());
}

TEST(MeasuredObject, WhatIsNotLocatedIsRefusedWithTheNamesThereAre) {
  const auto lost = object_named(measured(), "lost");
  EXPECT_EQ(lost.error().reason, Reason::bad_value);
  EXPECT_THAT(lost.error().message, HasSubstr("FS, femur: entry, tibia: entry, femur"));
}

}  // namespace measured_object_test
}  // namespace helicarm::case_registration
