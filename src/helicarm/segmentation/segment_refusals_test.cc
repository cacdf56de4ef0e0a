// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/segmentation/scene_test.h"

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr, testing::Not;

TEST(Segment, TwoClicksOnOneBoneAreRefused) {
  const Failure refused = refusal_of(plain_ct(), {on_upper, {"again", {0, 0, 25}}});
  EXPECT_EQ(refused.reason, Reason::seeds_in_one_bone);
  EXPECT_THAT(refused.message, HasSubstr("upper (0.0, 0.0, 46.0) mm and again (0.0, 0.0, 25.0) mm"));
}

TEST(Segment, AClickBesideTheBoneNamesTheNearestOne) {
  const Failure refused = refusal_of(plain_ct(), {{"upper", {22, 0, 25}}});
  EXPECT_EQ(refused.reason, Reason::seed_off_bone);
  EXPECT_THAT(refused.message,
              HasSubstr("upper: the seed (22.0, 0.0, 25.0) mm has 40 HU, bone begins at 200"));
  EXPECT_NEAR(refused.figures.at("nearest_mm"), 6, 1.1);
}

TEST(Segment, TheNearestBoneIsNoSpeck) {
  TestCt ct = ct_of({upper}, {1, 1, 1});
  const Vector3d speck = ct.volume.patient_from_voxel.inverse() * Vector3d(23, 0, 25);
  ct.volume.voxels[std::size_t(speck.x() + 53 * (speck.y() + 53 * speck.z()))] = 500;
  const Failure refused = refusal_of(ct, {{"upper", {22, 0, 25}}});
  EXPECT_NEAR(refused.figures.at("nearest_mm"), 6, 1.1);
  const Failure on_speck = refusal_of(ct, {{"upper", {23, 0, 25}}});
  EXPECT_THAT(on_speck.message, HasSubstr("lies on a speck of 1 voxels"));
  EXPECT_NEAR(on_speck.figures.at("nearest_mm"), 7, 1.1);
}

TEST(Segment, WithoutABoneThereIsNoNearestOne) {
  TestCt ct = ct_of({}, {1, 1, 1}, Eigen::Matrix3d::Identity(), {10, 10, 10});
  ct.volume.voxels[1000] = 500;
  EXPECT_THAT(refusal_of(ct, {{"upper", {0, 0, 0}}}).message, HasSubstr("no bone has 50 voxels or more"));
}

TEST(Segment, AClickOnASpeckIsRefused) {
  TestCt ct = ct_of({upper}, {1, 1, 1});
  ct.volume.voxels[ct.volume.voxels.size() / 4] = 500;
  const Eigen::Vector3i size = ct.volume.size;
  const auto i = int(ct.volume.voxels.size() / 4);
  const Vector3d at =
      ct.volume.patient_from_voxel * Vector3d(i % size.x(), i / size.x() % size.y(), i / size.x() / size.y());
  const Failure refused = refusal_of(ct, {{"upper", at}});
  EXPECT_EQ(refused.reason, Reason::seed_off_bone);
  EXPECT_THAT(refused.message, HasSubstr("lies on a speck of 1 voxels"));
}

TEST(Segment, AClickInRasIsRecognised) {
  const TestCt ct = ct_of({{{12, 0, 0}, {6, 6, 6}}}, {1, 1, 1}, Eigen::Matrix3d::Identity(), {24, 10, 10});
  EXPECT_THAT(refusal_of(ct, {{"bone", {-12, 0, 0}}}).message, HasSubstr("as R, A, S the seed lies on bone"));
}

TEST(Segment, AClickOffTheBoneOfAnImageThatIsNoCtSaysSo) {
  EXPECT_THAT(refusal_of(plain_ct(), {{"upper", {22, 0, 25}}}).message,
              HasSubstr("values of 40 to 1200 are hardly Hounsfield units"));
  TestCt ct = plain_ct();
  for (std::size_t i = 0; i < ct.truth.size(); ++i)
    if (ct.truth[i] == 0) ct.volume.voxels[i] = -100;
  EXPECT_THAT(refusal_of(ct, {{"upper", {22, 0, 25}}}).message, Not(HasSubstr("Hounsfield")));
}

TEST(Segment, AClickOutsideTheVolumeIsRefusedWithItsExtent) {
  const Failure refused = refusal_of(plain_ct(), {{"upper", {0, 0, 80}}});
  EXPECT_EQ(refused.reason, Reason::bad_value);
  EXPECT_THAT(refused.message, HasSubstr("lies outside the CT, which extends from (-26.0, -26.0, -56.0) mm"));
}

TEST(Segment, UnusableClicksAreRefused) {
  EXPECT_EQ(refusal_of(plain_ct(), {}).reason, Reason::bad_value);
  EXPECT_EQ(refusal_of(plain_ct(), {{"a/b", on_upper.point}}).reason, Reason::bad_value);
  EXPECT_EQ(refusal_of(plain_ct(), {on_upper, on_upper}).reason, Reason::name_clash);
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(refusal_of(plain_ct(), {{"a", {0, nothing, 0}}}).reason, Reason::not_finite);
  EXPECT_EQ(refusal_of(plain_ct(), {on_upper}, {.neck = 2}).reason, Reason::bad_value);
}

TEST(Segment, ValuesThatAreNoHounsfieldUnitsAreRefused) {
  EXPECT_THAT(refusal_of(plain_ct(), {on_upper}, {.threshold_hu = 3000}).message,
              HasSubstr("no voxel reaches the threshold 3000 HU: the CT's values are 40 to 1200"));
  EXPECT_THAT(refusal_of(plain_ct(), {on_upper}, {.threshold_hu = 0}).message,
              HasSubstr("100 % of the voxels reach the threshold 0 HU"));
}

}  // namespace
}  // namespace helicarm::segmentation
