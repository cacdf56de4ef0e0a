// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/broken_bone.h"

#include <vector>

#include <gtest/gtest.h>

#include "helicarm/registration/cut_scene_test.h"

namespace helicarm::registration {
namespace broken_test {

using geometry::RigidTransform;

/// A refused registration whose patches agree below the cut and, by `beyond`, not beyond it.
struct Refused : CutScene {
  int registered = 0;
  RigidTransform of_part[2] = {found.world_from_model,
                               found.world_from_model};  ///< of the part below and of the one beyond
  bool is_refused[2] = {false, false};

  explicit Refused(double beyond = 0.05) : CutScene({beyond, beyond}) {}
  auto broken() {
    return broken_bone(model, views, found, [&](const Model& part, const RigidTransform&) {
      ++registered;
      const std::size_t side = part.centre.z() < cut_z ? 0 : 1;
      Registration result;
      result.world_from_model = of_part[side];
      result.centre = of_part[side] * part.centre;
      result.covariance = RigidCovariance::Identity() * 1e-4;
      if (is_refused[side]) result.failure = Failure{Reason::wrong_model, "refused"};
      return result;
    });
  }
};

TEST(BrokenBone, TwoPartsAtTwoPosesAreNamed) {
  Refused refused;
  refused.of_part[1].translation.x() += 6;
  const auto broken = refused.broken();
  ASSERT_TRUE(broken);
  EXPECT_NEAR(broken->cut.z(), cut_z, 3);
  EXPECT_NEAR(broken->from_end_mm, 63 - cut_z, 3);
  EXPECT_NEAR(broken->moved_mm, 6, 1e-6);
  EXPECT_NEAR(broken->turned_deg, 0, 1e-6);
}

TEST(BrokenBone, PartsOfOnePoseAreOneBone) { EXPECT_FALSE(Refused().broken()); }

TEST(BrokenBone, APartThatIsRefusedIsNoPiece) {
  for (const std::size_t side : {0, 1}) {
    Refused refused;
    refused.of_part[1].translation.x() += 6;
    refused.is_refused[side] = true;
    EXPECT_FALSE(refused.broken()) << side;
  }
}

TEST(BrokenBone, WhatAgreesAlikeEverywhereIsNotCut) {
  Refused refused(0.65);
  refused.of_part[1].translation.x() += 6;
  EXPECT_FALSE(refused.broken());
  EXPECT_EQ(refused.registered, 0);
}

TEST(BrokenBone, OneViewIsNotEnough) {
  Refused refused;
  refused.of_part[1].translation.x() += 6;
  refused.views.pop_back();
  refused.found.views.pop_back();
  EXPECT_FALSE(refused.broken());
}

}  // namespace broken_test
}  // namespace helicarm::registration
