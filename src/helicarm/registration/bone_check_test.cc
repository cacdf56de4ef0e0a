// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/bone_check.h"

#include <cmath>
#include <functional>

#include <gmock/gmock.h>

#include "helicarm/core/random.h"
#include "helicarm/guidance/bone_check_description.h"
#include "helicarm/phantom/mesh.h"
#include "helicarm/registration/bone_surface.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr double half_length_mm = 22;

/// A bone about the z axis of its own frame, and how far its wall is from that axis along x.
struct Shape {
  phantom::SignedDistance distance;
  double half_width_mm;
};

Shape cylinder(double radius) {
  return {[radius](const Vector3d& p) {
            return std::max(std::hypot(p.x(), p.y()) - radius, std::abs(p.z()) - half_length_mm);
          },
          radius};
}
Shape box(double half_width) {
  return {[half_width](const Vector3d& p) {
            return (p.cwiseAbs() - Vector3d(half_width, half_width + 3, half_length_mm)).maxCoeff();
          },
          half_width};
}
Shape ball(double radius) {
  return {[radius](const Vector3d& p) { return p.norm() - radius; }, radius};
}

struct Voxels {
  Vector3d spacing;
  bool partial = false;                ///< whether the CT shows what share of a voxel is bone
  double end_mm = 2 * half_length_mm;  ///< where the CT ends along z
};

/// A CT of the shape at a pose, with its mask.
std::shared_ptr<const BoneSurface> in_volume(const Shape& shape, const Eigen::Affine3d& model_from_bone,
                                             const Voxels& voxels) {
  volume::Volume ct;
  const double half_mm = half_length_mm + 10;
  ct.size = (2 * half_mm / voxels.spacing.array()).cast<int>();
  ct.size.z() = int((half_mm + std::min(half_mm, voxels.end_mm)) / voxels.spacing.z());
  ct.patient_from_voxel = Eigen::Translation3d(Vector3d::Constant(-half_mm) + model_from_bone.translation()) *
                          Eigen::Scaling(voxels.spacing);
  volume::Volume mask = ct;
  const Eigen::Affine3d bone_from_model = model_from_bone.inverse();
  for (int z = 0; z < ct.size.z(); ++z)
    for (int y = 0; y < ct.size.y(); ++y)
      for (int x = 0; x < ct.size.x(); ++x) {
        const Vector3d at = bone_from_model * (ct.patient_from_voxel * Vector3d(x, y, z));
        const double outside = shape.distance(at);
        const double width = voxels.spacing.mean();
        const double share = std::clamp(0.5 - outside / width, 0.0, 1.0);
        mask.voxels.push_back(share >= 0.5 ? 1 : 0);
        ct.voxels.push_back(static_cast<float>(40 + 800 * (voxels.partial ? share : std::round(share))));
      }
  return bone_surface(ct, mask, std::nullopt);
}

std::shared_ptr<const BoneSurface> in_mesh(const Shape& shape, const Eigen::Affine3d& model_from_bone) {
  const Vector3d half = Vector3d::Constant(half_length_mm + 6);
  phantom::TriangleMesh mesh = phantom::surface_of(shape.distance, {-half, half}, 0.9);
  for (Vector3d& corner : mesh.corners) corner = model_from_bone * corner;
  return bone_surface(*prepare_surface(std::move(mesh), "bone"), 0);
}

struct Planted {
  Shape shape;
  double bridge_mm, diameter_mm;
  bool through;
};

/// A tunnel along the bone's axis beside its wall.
BoneTunnel tunnel_of(const Planted& planted, const Eigen::Affine3d& model_from_bone) {
  const double x = planted.shape.half_width_mm - planted.diameter_mm / 2 - planted.bridge_mm;
  return {model_from_bone * Vector3d(x, 0, -half_length_mm - 3),
          model_from_bone * Vector3d(x, 0, planted.through ? half_length_mm + 3 : 6), planted.diameter_mm};
}

BoneCheck checked(const Shape& shape, const BoneTunnel& tunnel) {
  return check_tunnel(*in_mesh(shape, Eigen::Affine3d::Identity()), tunnel);
}

TEST(CheckTunnel, OpeningsAndWallOfATunnelThroughABox) {
  const BoneCheck check = checked(box(10), {{4, 0, -30}, {4, 0, 30}, 6.0});
  EXPECT_NEAR(*check.bridge_mm, 3, 0.05);
  EXPECT_NEAR(check.length_in_bone_mm, 44, 0.05);
  EXPECT_LT((*check.entry - Vector3d(4, 0, -22)).norm(), 0.05);
  EXPECT_LT((*check.exit - Vector3d(4, 0, 22)).norm(), 0.05);
  EXPECT_NEAR(*check.entry_angle_deg, 90, 1);
  EXPECT_FALSE(check.is_breach());
}

TEST(CheckTunnel, ABlindTunnelHasOneOpeningAndBoneAhead) {
  const BoneCheck check = checked(box(10), {{4, 0, -30}, {4, 0, 18}, 6.0});
  EXPECT_NEAR(*check.bridge_mm, 3, 0.05);
  EXPECT_FALSE(check.exit);
  EXPECT_NEAR(*check.end_mm, 4, 0.05);
  EXPECT_NEAR(check.length_in_bone_mm, 40, 0.05);
}

TEST(CheckTunnel, AStartPickedBelowTheSurfaceIsLedBackToIt) {
  const BoneCheck check = checked(box(10), {{0, 0, -19}, {0, 0, 30}, 6.0});
  EXPECT_LT((*check.entry - Vector3d(0, 0, -22)).norm(), 0.05);
  EXPECT_NEAR(check.length_in_bone_mm, 44, 0.05);
}

TEST(CheckTunnel, ALineDrawnFromTheBlindEndIsDrilledFromTheOtherSide) {
  const BoneCheck check = checked(box(10), {{4, 0, 10}, {4, 0, -30}, 6.0});
  EXPECT_LT((*check.entry - Vector3d(4, 0, -22)).norm(), 0.05);
  EXPECT_NEAR(*check.end_mm, 12, 0.05);
  EXPECT_NEAR(*check.bridge_mm, 3, 0.05);
}

TEST(CheckTunnel, AnObliqueEntryIsNoBreach) {
  // Enters the box's broad face at 40 degrees and ends inside.
  const Vector3d way(-std::sin(0.7), 0, std::cos(0.7));
  const Vector3d entry(10, 0, -8);
  const BoneCheck check = checked(box(10), {entry - 8 * way, entry + 18 * way, 6.0});
  EXPECT_FALSE(check.is_breach());
  EXPECT_NEAR(*check.entry_angle_deg, 40, 2);
  EXPECT_GT(*check.bridge_mm, 2);
}

TEST(CheckTunnel, AnEdgeBesideTheOpeningCounts) {
  // The wall diverges from the tunnel by 20 degrees behind an edge 1 mm beside the opening.
  const double turn = 20 * std::numbers::pi / 180;
  const Shape wedge{[&](const Vector3d& p) {
                      return std::max({std::cos(turn) * (p.x() - 5) - std::sin(turn) * (p.z() + 15),
                                       -15 - p.z(), p.z() - 15, -p.x() - 10, std::abs(p.y()) - 10});
                    },
                    0};
  const BoneCheck check = checked(wedge, {{0, 0, -20}, {0, 0, 10}, 8.0});
  EXPECT_NEAR(*check.bridge_mm, 1.1, 0.2);
  EXPECT_LT(*check.at_mm, 1);
}

TEST(CheckTunnel, AWallThatClosesInBehindTheEndCounts) {
  const double turn = 30 * std::numbers::pi / 180;
  const Shape wedge{[&](const Vector3d& p) {
                      return std::max({std::cos(turn) * (p.x() - 7) + std::sin(turn) * (p.z() - 5),
                                       -15 - p.z(), p.z() - 20, -p.x() - 12, std::abs(p.y()) - 12});
                    },
                    0};
  // The plane x = 7 - tan(30) (z - 5) is (7 - 4) cos(30) from the rim of the end.
  const BoneCheck check = checked(wedge, {{0, 0, -20}, {0, 0, 5}, 8.0});
  EXPECT_NEAR(*check.bridge_mm, 3 * std::cos(turn), 0.1);
  EXPECT_NEAR(*check.at_mm, 20, 0.6);
}

TEST(CheckTunnel, AGrooveAlongTheWallIsNoFaceOfTheOpening) {
  // Enters half a millimetre beside the box's edge and leaves its side by 10 degrees.
  const Vector3d way(-std::sin(0.17), 0, std::cos(0.17)), entry(9.5, 0, -half_length_mm);
  const BoneTunnel tunnel{entry - 5 * way, entry + 30 * way, 4.6};
  for (const auto& bone :
       {in_mesh(box(10), Eigen::Affine3d::Identity()),
        in_volume(box(10), Eigen::Affine3d::Identity(), {Vector3d::Constant(0.5), true})}) {
    const BoneCheck check = check_tunnel(*bone, tunnel);
    EXPECT_TRUE(check.is_breach());
    EXPECT_LT(*check.bridge_mm, -1);
    EXPECT_GT(*check.entry_angle_deg, 70);
  }
}

TEST(CheckTunnel, ALineThroughTheCtsEndIsNotCompared) {
  const auto bone = in_volume(cylinder(9), Eigen::Affine3d::Identity(), {Vector3d::Constant(0.5), true, 12});
  for (const double tilt : {0.0, 0.03, 0.07, 0.14, 0.2}) {
    const Vector3d way(std::sin(tilt), 0, -std::cos(tilt)), cut(0, 0, 12);
    const BoneTunnel tunnel{cut - 5 * way, cut + 20 * way, 4.0};
    for (const BoneTunnel& each : {tunnel, BoneTunnel{tunnel.end, tunnel.start, 4.0}}) {
      const BoneCheck check = check_tunnel(*bone, each);
      EXPECT_FALSE(check.entry) << tilt;
      EXPECT_EQ(check.no_entry, guidance::NoEntry::beyond_ct) << tilt;
      EXPECT_TRUE(check.is_breach());
    }
  }
}

TEST(CheckTunnel, AnObliqueEntryBesideASteeperFaceIsNoBreach) {
  // Through the side 4 mm behind the edge, at 35 degrees; the end's face is steeper to the axis.
  const Vector3d way(-std::sin(0.61), 0, std::cos(0.61)), entry(10, 0, -half_length_mm + 3.4);
  const BoneCheck check = checked(box(10), {entry - 8 * way, entry + 14 * way, 4.0});
  EXPECT_NEAR(*check.entry_angle_deg, 35, 4);
  EXPECT_FALSE(check.is_breach()) << *check.bridge_mm << " at " << *check.at_mm;
}

TEST(CheckTunnel, ALineThatReentersBehindTheCtsEndIsNotCompared) {
  const Shape notched{[](const Vector3d& p) {
                        const double whole = (p.cwiseAbs() - Vector3d(10, 10, 30)).maxCoeff();
                        return std::max(whole, std::min(3 - std::abs(p.z()), 30.0));
                      },
                      10};
  const auto bone = in_volume(notched, Eigen::Affine3d::Identity(), {Vector3d::Constant(0.5), true, 12});
  for (const BoneTunnel& each :
       {BoneTunnel{{0, 0, 16}, {0, 0, -20}, 4.0}, BoneTunnel{{0, 0, -20}, {0, 0, 16}, 4.0}}) {
    const BoneCheck check = check_tunnel(*bone, each);
    EXPECT_FALSE(check.entry);
    EXPECT_EQ(check.no_entry, guidance::NoEntry::beyond_ct);
  }
}

TEST(CheckTunnel, ABlindEndBeyondTheCtIsNotCompared) {
  const auto bone = in_volume(cylinder(9), Eigen::Affine3d::Identity(), {Vector3d::Constant(0.5), true, 12});
  const BoneCheck check = check_tunnel(*bone, {{0, 0, -30}, {0, 0, 16}, 4.0});
  EXPECT_EQ(check.no_entry, guidance::NoEntry::beyond_ct);
  EXPECT_FALSE(check.entry);
}

TEST(CheckTunnel, ALineBetweenTwoPlacesDeepInTheBoneOpensNowhere) {
  const BoneCheck check = checked(box(10), {{0, 0, -11}, {0, 0, 8}, 4.0});
  EXPECT_FALSE(check.entry);
  EXPECT_EQ(check.no_entry, guidance::NoEntry::opens_nowhere);
  const Json json = output_of([&](OutputJson& output) { guidance::describe_bone_check(output, check); });
  EXPECT_NE(json["note"].get<std::string>().find("opens nowhere"), std::string::npos);
}

TEST(CheckTunnel, ALineBesideTheBoneIsABreach) {
  const BoneCheck check = checked(box(10), {{15, 0, -30}, {15, 0, 30}, 6.0});
  EXPECT_FALSE(check.entry);
  EXPECT_EQ(check.length_in_bone_mm, 0);
  EXPECT_TRUE(check.is_breach());
}

TEST(CheckTunnel, AnAxisThatLeavesAndReentersIsABreach) {
  const Shape notched{[](const Vector3d& p) {
                        const double whole = (p.cwiseAbs() - Vector3d(10, 10, 20)).maxCoeff();
                        return std::max(whole, std::min(std::min(p.x() - 1, 3 - std::abs(p.z())), 30.0));
                      },
                      10};
  const BoneCheck check = checked(notched, {{4, 0, -25}, {4, 0, 25}, 4.0});
  EXPECT_NEAR(check.length_in_bone_mm, 34, 0.5);
  EXPECT_LE(*check.bridge_mm, -2);
  EXPECT_TRUE(check.is_breach());
}

TEST(CheckTunnel, WithoutADiameterOnlyTheAxisIsCompared) {
  const BoneCheck check = checked(box(10), {{4, 0, -30}, {4, 0, 30}, std::nullopt});
  EXPECT_NEAR(check.length_in_bone_mm, 44, 0.05);
  EXPECT_FALSE(check.bridge_mm);
  EXPECT_FALSE(check.is_breach());
  const Json json = output_of([&](OutputJson& output) { guidance::describe_bone_check(output, check); });
  EXPECT_TRUE(json["note"].is_string());
}

TEST(CheckTunnel, TwoTunnelsByTheirWalls) {
  const auto bone = in_mesh(box(15), Eigen::Affine3d::Identity());
  const BoneCheck a = check_tunnel(*bone, {{-5, 0, -30}, {-5, 0, 30}, 6.0});
  const BoneCheck b = check_tunnel(*bone, {{5, -30, 0}, {5, 30, 0}, 8.0});
  EXPECT_NEAR(tunnel_distance_mm(a, b), 3, 0.05);
  EXPECT_NEAR(tunnel_distance_mm(a, a), -6, 0.05);
}

/// Cylinders, boxes and balls with a planted bridge of -2 to 6 mm, at random poses.
struct Trials {
  int breaches = 0, missed = 0, whole = 0, falsely = 0, n = 0;
  double squares = 0;

  void run(int count, std::uint32_t stream,
           const std::function<std::shared_ptr<const BoneSurface>(const Shape&, const Eigen::Affine3d&,
                                                                  RandomStream&)>& image) {
    for (int trial = 0; trial < count; ++trial) {
      RandomStream random(4301, stream, std::uint64_t(trial));
      const double width = 11 + 6 * random.uniform();
      const int kind = trial % 3;
      Planted planted{kind == 0   ? cylinder(width)
                      : kind == 1 ? box(width)
                                  : ball(width + 6),
                      0, 5 + 4 * random.uniform(), random.uniform() < 0.5};
      planted.bridge_mm = -2 + 8 * random.uniform();
      if (kind == 2) planted.through = true;  // its wall is nearest in the middle
      Eigen::Affine3d pose = Eigen::Affine3d::Identity();
      const Vector3d turn(random.normal(), random.normal(), random.normal());
      pose.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
      pose.translation() = Vector3d(random.normal(), random.normal(), random.normal());
      const BoneCheck check = check_tunnel(*image(planted.shape, pose, random), tunnel_of(planted, pose));
      ASSERT_TRUE(check.bridge_mm) << trial;
      const double error = *check.bridge_mm - planted.bridge_mm;
      squares += error * error, ++n;
      ++(planted.bridge_mm < 0 ? breaches : whole);
      missed += planted.bridge_mm < 0 && !check.is_breach();
      falsely += planted.bridge_mm >= 0 && check.is_breach();
    }
  }
  void expect_found() const {
    EXPECT_LT(std::sqrt(squares / n), 0.3);
    EXPECT_GT(breaches, 5);
    EXPECT_EQ(missed, 0) << "of " << breaches;
    EXPECT_LE(falsely, 0.05 * whole + 1) << "of " << whole;
  }
};

TEST(PlantedBridges, OfMasksWithUnequalVoxels) {
  Trials trials;
  trials.run(36, 1, [](const Shape& shape, const Eigen::Affine3d& pose, RandomStream& random) {
    const double fine = 0.4 + 0.2 * random.uniform();
    return in_volume(shape, pose, {{fine, fine, 0.8 + 0.45 * random.uniform()}, random.uniform() < 0.5});
  });
  trials.expect_found();
}

TEST(PlantedBridges, OfSurfaces) {
  Trials trials;
  trials.run(36, 2, [](const Shape& shape, const Eigen::Affine3d& pose, RandomStream&) {
    return in_mesh(shape, pose);
  });
  trials.expect_found();
}

}  // namespace
}  // namespace helicarm::registration
