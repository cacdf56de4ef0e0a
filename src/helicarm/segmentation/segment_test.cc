// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/segment.h"

#include <algorithm>
#include <array>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/segmentation/scene_test.h"
#include "helicarm/simulation/knee.h"
#include "helicarm/volume/axis_order.h"
#include "helicarm/volume/label_map.h"

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3d;
using testing::ElementsAre, testing::HasSubstr, testing::IsEmpty;

TEST(Segment, OneClickSeparatesABoneFromTheOneItTouches) {
  const auto made = segment(plain_ct().volume, std::vector{on_lower}, {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_EQ(made->threshold_hu, 200);
  EXPECT_GT(dice(plain_ct(), 2, *made, 1), 0.96);
  ASSERT_EQ(made->bones.size(), 1U);
  const Bone& bone = made->bones[0];
  EXPECT_NEAR(bone.volume_cm3, lower.volume_cm3(), 0.09 * lower.volume_cm3());
  EXPECT_LT((bone.centre - lower.centre).norm(), 0.5);
  EXPECT_NEAR(bone.box.max().z(), 4, 1.1);
  EXPECT_THAT(bone.cut_off, IsEmpty());
  ASSERT_EQ(bone.contacts.size(), 1U);
  EXPECT_EQ(bone.contacts[0].with, "");
  EXPECT_NEAR(bone.contacts[0].with_cm3, upper.volume_cm3(), 0.09 * upper.volume_cm3());
  EXPECT_EQ(bone.left_out_cm3, bone.contacts[0].with_cm3);
  EXPECT_NEAR(bone.left_out_percent, 100 * upper.volume_cm3() / (upper.volume_cm3() + lower.volume_cm3()), 3);
  EXPECT_LT((bone.contacts[0].at - Vector3d(0, 0, 3.5)).norm(), 4);
  EXPECT_THAT(made->warnings, IsEmpty());
}

TEST(Segment, EachClickIsABone) {
  const auto made = segment(plain_ct().volume, std::vector{on_upper, on_lower}, {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_GT(dice(plain_ct(), 1, *made, 1), 0.96);
  EXPECT_GT(dice(plain_ct(), 2, *made, 2), 0.96);
  EXPECT_EQ(made->bones[0].contacts.at(0).with, "lower");
  EXPECT_EQ(made->bones[1].contacts.at(0).with, "upper");
  EXPECT_EQ(made->bones[0].left_out_cm3, 0);
}

/// The same voxels in memory in another order: `axis` and `sign` for each axis in turn.
volume::Volume stored_otherwise(const volume::Volume& ct, const std::array<int, 3>& axis,
                                const Vector3d& sign) {
  volume::AxisOrder order;
  order.turn.setZero();
  for (int k = 0; k < 3; ++k) order.turn(axis[std::size_t(k)], k) = int(sign[k]);
  order.first = (-(order.turn * (ct.size.array() - 1).matrix())).cwiseMax(0);
  const Eigen::Vector3i size = order.turn.cwiseAbs() * ct.size;
  return {size,
          volume::reordered(ct.voxels, ct.size, order, size),
          ct.patient_from_voxel * order.inverse().affine(),
          {}};
}

TEST(Segment, TheOrderOfTheAxesInMemoryChangesNothing) {
  const volume::Volume& ct = plain_ct().volume;
  const std::vector<Seed> seeds{on_upper, on_lower};
  const auto usual = segment(ct, seeds, {});
  ASSERT_TRUE(usual) << usual.error().message;
  for (const std::array<int, 3>& axis : {std::array{0, 1, 2}, std::array{2, 0, 1}, std::array{0, 2, 1}})
    for (const Vector3d& sign :
         {Vector3d(-1, 1, 1), Vector3d(1, -1, 1), Vector3d(1, 1, -1), Vector3d(-1, -1, -1)}) {
      volume::Volume other = stored_otherwise(ct, axis, sign);
      const auto made = segment(other, seeds, {});
      ASSERT_TRUE(made) << made.error().message;
      EXPECT_EQ(made->patient_from_voxel.matrix(), other.patient_from_voxel.matrix());
      EXPECT_EQ(made->bones[0].voxels, usual->bones[0].voxels);
      EXPECT_LT((made->bones[0].centre - usual->bones[0].centre).norm(), 1e-9);
      const Bone& bone = made->bones[1];
      const Eigen::AlignedBox3d box = Eigen::AlignedBox3d(bone.low.cast<double>(), bone.high.cast<double>())
                                          .transformed(other.patient_from_voxel);
      EXPECT_TRUE(box.isApprox(bone.box, 1e-9));
      other.voxels.assign(made->labels.begin(), made->labels.end());
      ASSERT_TRUE(volume::onto_grid(other, ct));
      EXPECT_TRUE(std::ranges::equal(other.voxels, usual->labels));
    }
}

TEST(Segment, ASeedOnAFaceIsWithinOrNotWhateverTheOrderOfTheAxes) {
  const volume::Volume& ct = plain_ct().volume;
  const volume::Volume other = stored_otherwise(ct, {0, 1, 2}, {-1, -1, -1});
  const Vector3d middle = 0.5 * (ct.size.cast<double>().array() - 1).matrix();
  for (int axis = 0; axis < 3; ++axis)
    for (const double at : {-0.5, ct.size[axis] - 0.5}) {
      Vector3d face = middle;
      face[axis] = at;
      const std::vector<Seed> seeds{{"face", ct.patient_from_voxel * face}};
      const auto usual = segment(ct, seeds, {}), made = segment(other, seeds, {});
      ASSERT_FALSE(usual || made);
      EXPECT_EQ(usual.error().reason, made.error().reason) << axis << " " << at;
    }
}

TEST(Segment, TheWaistOfAShaftIsNoJoint) {
  std::vector<TestBone> spheres;
  for (int z = -40; z <= 40; z += 4)
    spheres.push_back({{0, 0, double(z)}, Vector3d::Constant(6 + 6 * std::pow(z / 40.0, 2))});
  const TestCt ct = ct_of(spheres, {1, 1, 1}, Eigen::Matrix3d::Identity(), {15, 15, 55});
  const auto made = segment(ct.volume, std::vector<Seed>{{"ulna", {0, 0, 47}}}, {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_NEAR(made->bones[0].box.min().z(), -52, 1.1);
  EXPECT_EQ(made->bones[0].left_out_cm3, 0);
  EXPECT_THAT(made->warnings, IsEmpty());
  EXPECT_EQ(refusal_of(ct, {{"ulna", {0, 0, 47}}, {"again", {0, 0, -47}}}).reason, Reason::seeds_in_one_bone);
}

/// A ball on a neck on a shaft, as a femur's head, in the socket of another bone that it touches.
std::vector<TestBone> femoral_head(double neck_mm) {
  constexpr double head_mm = 16, middle = 30;
  std::vector<TestBone> solids{{{0, 0, middle}, Vector3d::Constant(head_mm)}};
  const double end = middle - std::sqrt(head_mm * head_mm - neck_mm * neck_mm);
  for (double z = end - 1.6 * neck_mm; z < end + 2; z += 2)
    solids.push_back({{0, 0, z}, Vector3d::Constant(neck_mm)});
  solids.push_back({{0, 0, -18}, {13, 17, 24}});
  return solids;
}

TEST(Segment, AHeadOnItsNeckIsOneBone) {
  for (const double neck_mm : {7.0, 8.0, 10.0}) {
    const TestCt ct = ct_of(femoral_head(neck_mm), {1, 1, 1}, Eigen::Matrix3d::Identity(), {20, 20, 50});
    for (const double z : {44.0, -38.0}) {
      const auto made = segment(ct.volume, std::vector<Seed>{{"femur", {0, 0, z}}}, {});
      ASSERT_TRUE(made) << made.error().message;
      EXPECT_EQ(made->bones[0].left_out_cm3, 0) << neck_mm;
    }
  }
}

TEST(Segment, AHeadThatTouchesItsSocketIsApartFromIt) {
  std::vector<TestBone> bones = femoral_head(8);
  bones.push_back({{0, 0, 60}, {18, 18, 16}});
  const TestCt ct = ct_of(bones, {1, 1, 1}, Eigen::Matrix3d::Identity(), {22, 22, 78});
  const auto made = segment(ct.volume, std::vector<Seed>{{"femur", {0, 0, 30}}}, {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_NEAR(made->bones[0].left_out_cm3, bones.back().volume_cm3(), 0.1 * bones.back().volume_cm3());
}

TEST(Segment, AirInTheMarrowWhereTheVolumeCutsABone) {
  const TestBone shaft{{0, 0, -40}, {13, 12, 90}};
  TestCt ct = ct_of({shaft}, {1, 1, 1}, Eigen::Matrix3d::Identity(), {20, 20, 30});
  for (std::size_t i = 0; i < ct.truth.size(); ++i)
    if (ct.truth[i] == 0) ct.volume.voxels[i] = -1000;
  const Vector3d marrow = ct.volume.patient_from_voxel.inverse() * Vector3d(0, 0, 30);
  const auto i = std::size_t(marrow.x() + 41 * (marrow.y() + 41 * marrow.z()));
  ct.volume.voxels[i] = ct.volume.voxels[i + 1] = -700;
  const auto made = segment(ct.volume, std::vector<Seed>{{"shaft", {0, 0, 10}}}, {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_GT(dice(ct, 1, *made, 1), 0.95);
}

TEST(Segment, ThickSlicesOfATurnedVolume) {
  const Eigen::Matrix3d turn = geometry::rotation_from_vector({0.5, -0.3, 0.8});
  Eigen::Matrix3d left_handed = turn;
  left_handed.col(1) *= -1;
  const TestCt ct = ct_of({upper, lower}, {0.9, 0.8, 2}, left_handed, {40, 40, 60});
  const auto made = segment(ct.volume, std::vector{on_upper, on_lower}, {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_GT(dice(ct, 1, *made, 1), 0.94);
  EXPECT_GT(dice(ct, 2, *made, 2), 0.94);
  EXPECT_LT((made->bones[0].centre - upper.centre).norm(), 0.6);
}

TEST(Segment, AHoleInTheCortexDoesNotOpenTheMarrow) {
  const auto hole = [](const Vector3d& p) { return std::hypot(p.x(), p.z() - 25) < 0.8; };
  const TestCt ct = ct_of({upper}, {0.8, 0.8, 0.8}, Eigen::Matrix3d::Identity(), {22, 22, 50}, hole);
  const auto made = segment(ct.volume, std::vector{on_upper}, {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_GT(dice(ct, 1, *made, 1), 0.95);
  const auto open = segment(ct.volume, std::vector{on_upper}, {.gap_mm = 0});
  ASSERT_TRUE(open);
  EXPECT_LT(open->bones[0].volume_cm3, 0.6 * made->bones[0].volume_cm3);
}

TEST(Segment, MarrowOfAShaftThatTheVolumeCutsOffIsFilled) {
  const TestBone shaft{{0, 0, -40}, {13, 12, 90}};
  const TestCt ct = ct_of({shaft}, {1, 1, 1}, Eigen::Matrix3d::Identity(), {20, 20, 30});
  const auto made = segment(ct.volume, std::vector<Seed>{{"shaft", {0, 0, 10}}}, {});
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_GT(dice(ct, 1, *made, 1), 0.95);
  EXPECT_THAT(made->bones[0].cut_off, ElementsAre("inferior", "superior"));
  ASSERT_EQ(made->notes.size(), 1U);
  EXPECT_EQ(made->notes[0].reason, Reason::bone_cut_off);
}

TEST(Segment, ABoneThatIsNearlyAsWideWhereItMeetsAnotherIsReported) {
  const TestBone a{{0, 0, 15}, {14, 14, 20}}, b{{0, 0, -15}, {14, 14, 20}};
  const TestCt ct = ct_of({a, b}, {1, 1, 1}, Eigen::Matrix3d::Identity(), {18, 18, 38});
  const std::vector<Seed> both{{"a", {0, 0, 20}}, {"b", {0, 0, -20}}};
  const auto apart = segment(ct.volume, both, {});
  ASSERT_TRUE(apart) << apart.error().message;
  EXPECT_GT(dice(ct, 1, *apart, 1), 0.93);
  ASSERT_EQ(apart->warnings.size(), 1U);
  EXPECT_EQ(apart->warnings[0].reason, Reason::bones_in_contact);
  EXPECT_THAT(apart->warnings[0].message, HasSubstr("meets"));
  const auto one = segment(ct.volume, std::vector{both[0]}, {.neck = 0.6});
  ASSERT_TRUE(one);
  EXPECT_NEAR(one->bones[0].volume_cm3, 2 * apart->bones[0].volume_cm3, 1);
  ASSERT_EQ(one->warnings.size(), 1U);
  EXPECT_THAT(one->warnings[0].message, HasSubstr("is narrow at"));
}

/// A head and the half shell of a socket about it, 1.5 mm apart.
volume::Volume head_in_socket() {
  volume::Volume ct;
  ct.size = {50, 50, 50};
  const double voxel_mm = 0.75;
  ct.patient_from_voxel = Eigen::Translation3d(Eigen::Vector3d::Constant(-24.5 * voxel_mm)) *
                          Eigen::Affine3d(Eigen::Scaling(voxel_mm));
  for (int z = 0; z < 50; ++z)
    for (int y = 0; y < 50; ++y)
      for (int x = 0; x < 50; ++x) {
        const Eigen::Vector3d p = ct.patient_from_voxel * Eigen::Vector3d(x, y, z);
        const double r = p.norm();
        const bool bone = r < 11 || (r > 12.5 && r < 16 && p.z() > -2);
        ct.voxels.push_back(bone ? 900.0F : 40.0F);
      }
  return ct;
}

TEST(Segment, BonesThatOnlyAClosedJointSpaceHoldsTogetherAreReported) {
  const volume::Volume ct = head_in_socket();
  const std::vector<Seed> head{{"head", {0, 0, 0}}};
  const auto as_usual = segment(ct, head, {});
  ASSERT_TRUE(as_usual) << as_usual.error().message;
  const bool holds_socket = as_usual->bones[0].volume_cm3 > 8;  // 5.6 cm3 alone
  const bool is_told = std::ranges::any_of(as_usual->warnings, [](const Warning& warning) {
    return warning.message.find("do not touch") != std::string::npos;
  });
  EXPECT_EQ(is_told, holds_socket);
  EXPECT_TRUE(holds_socket);  // else the scene tests nothing
  const auto narrow = segment(ct, head, {.gap_mm = 0.4});
  ASSERT_TRUE(narrow) << narrow.error().message;
  EXPECT_NEAR(narrow->bones[0].volume_cm3, 5.6, 0.4);
  EXPECT_TRUE(narrow->warnings.empty()) << narrow->warnings[0].message;
}

TEST(Segment, AnExceptionOfTheProgressEndsIt) {
  std::vector<std::string> stages;
  const pipeline::Progress progress{[&](std::string_view stage) {
                                      stages.emplace_back(stage);
                                      if (stage == "distance") throw std::runtime_error("cancelled");
                                    },
                                    {}};
  EXPECT_THROW((void)segment(plain_ct().volume, std::vector{on_upper}, {}, progress), std::runtime_error);
  EXPECT_THAT(stages, ElementsAre("threshold", "fill", "distance"));
}

TEST(UsualThreshold, RisesWithTheNoise) {
  volume::Volume ct = plain_ct().volume;
  EXPECT_EQ(usual_threshold(ct), 200);
  RandomStream random(1, 2, 3);
  for (float& voxel : ct.voxels) voxel += static_cast<float>(60 * random.normal());
  EXPECT_GT(usual_threshold(ct), 230);
  EXPECT_LT(usual_threshold(ct), 340);
  // Without its surroundings the bone's own wide distribution is not taken for noise.
  for (std::size_t i = 0; i < ct.voxels.size(); ++i)
    ct.voxels[i] = plain_ct().truth[i] == 0 ? -1024.0F : ct.voxels[i] + 300;
  EXPECT_EQ(usual_threshold(ct), 200);
}

TEST(SeedFrom, IsANameAndAPoint) {
  const auto seed = seed_from("femur=1.5,-2,+3e1");
  ASSERT_TRUE(seed);
  EXPECT_EQ(seed->name, "femur");
  EXPECT_EQ(seed->point, Vector3d(1.5, -2, 30));
  for (const char* wrong :
       {"femur", "=1,2,3", "a=1,2", "a=1,2,3,4", "a=1,2,x", "a=1,,3", "a=1,2,3 ", "a=", "a=1,2,nan"})
    EXPECT_EQ(seed_from(wrong).error().reason, Reason::usage) << wrong;
}

/// The knee of the simulated X-ray images, 1.2 mm voxels, turned; truth: the outer solids.
struct KneeCt : TestCt {
  Eigen::Matrix3d turn = geometry::rotation_from_vector({0.2, 1.4, -0.3});

  KneeCt() {
    const simulation::Scene knee = simulation::knee_body();
    volume.size = {150, 92, 92};
    volume.patient_from_voxel = Eigen::Affine3d(turn) * Eigen::Scaling(1.2);
    const Vector3d middle(-10, 0, -8);
    volume.patient_from_voxel.translation() = turn * (middle - 1.2 * Vector3d(74.5, 45.5, 45.5));
    const std::vector<std::string> names{"femur", "tibia", "patella", "fibula"};
    const auto inside = [](const simulation::Body& body, const Vector3d& p) {
      return std::ranges::any_of(body.solids, [&](const auto& s) { return signed_distance(s, p) < 0; });
    };
    for (int z = 0; z < volume.size.z(); ++z)
      for (int y = 0; y < volume.size.y(); ++y)
        for (int x = 0; x < volume.size.x(); ++x) {
          const Vector3d p = middle + 1.2 * (Vector3d(x, y, z) - Vector3d(74.5, 45.5, 45.5));
          float hu = inside(knee[0], p) ? 50.0F : -1000.0F;
          int owner = 0;
          for (std::size_t bone = 0; bone < 4; ++bone)
            if (inside(knee[1 + 2 * bone], p)) {
              if (owner == 0) owner = int(bone) + 1;
              hu = inside(knee[2 + 2 * bone], p) ? 450.0F : 1300.0F;
            }
          truth.push_back(owner);
          volume.voxels.push_back(hu);
        }
  }
  Vector3d patient(const Vector3d& in_knee) const { return turn * in_knee; }
};

TEST(SegmentKnee, OneClickForEachBone) {
  const KneeCt ct;
  const std::vector<Seed> seeds{{"femur", ct.patient({-30, 10, -5})},
                                {"tibia", ct.patient({30, 0, -12})},
                                {"patella", ct.patient({-26, 0, 34})},
                                {"fibula", ct.patient({24, 37, -22})}};
  const auto all = segment(ct.volume, seeds, {});
  ASSERT_TRUE(all) << all.error().message;
  for (int bone = 1; bone <= 4; ++bone) EXPECT_GT(dice(ct, bone, *all, bone), 0.97) << bone;
  for (int bone = 1; bone <= 4; ++bone) {
    const auto alone = segment(ct.volume, std::vector{seeds[std::size_t(bone - 1)]}, {});
    ASSERT_TRUE(alone) << alone.error().message;
    EXPECT_GT(dice(ct, bone, *alone, 1), 0.97) << bone;
  }
}

}  // namespace
}  // namespace helicarm::segmentation
