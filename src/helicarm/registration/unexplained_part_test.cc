// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/unexplained_part.h"

#include <gmock/gmock.h>

#include "helicarm/registration/cut_scene_test.h"

namespace helicarm::registration {
namespace unexplained_test {

using geometry::RigidTransform;

struct Registered : CutScene {
  using CutScene::CutScene;

  auto part() const { return unexplained_part(model, views, found, nullptr); }

  /// If the part alone agrees by `agreement`, `moved_mm` from there, in so many places of each view.
  auto part_if(double agreement, double moved_mm, std::size_t places = 20) const {
    return unexplained_part(model, views, found, [&](const Model&, const RigidTransform& start) {
      Registration alone;
      alone.world_from_model = start;
      alone.world_from_model.translation.x() += moved_mm;
      alone.failure = Failure{Reason::registration_ambiguous, "a shaft turns about itself"};
      for (int i = 0; i < 2; ++i)
        alone.views.emplace_back().agreements.assign(places, {{80, 80}, agreement, 1});
      return alone;
    });
  }
};

TEST(UnexplainedPart, WhatAgreesWithNoViewIsNamedWithItsPlace) {
  const auto part = Registered({0.05, 0.15}).part();
  ASSERT_TRUE(part);
  EXPECT_NEAR(part->section.z(), cut_z, 5);
  EXPECT_GT(part->centre.z(), cut_z);
  EXPECT_LT(part->centre_of_rest.z(), cut_z);
  EXPECT_NEAR(part->agreements[0], 0.05, 0.1);
  EXPECT_NEAR(part->agreements[1], 0.15, 0.1);
  EXPECT_NEAR(part->agreements_elsewhere[0], 0.7, 0.1);
  EXPECT_NEAR(part->difference(), 0.6, 0.1);
}

TEST(UnexplainedPart, AMotionThatOneViewHardlyShowsIsNamed) { EXPECT_TRUE(Registered({0.6, -0.1}).part()); }

TEST(UnexplainedPart, ABoneAlongNoAxisOfItsCTIsCutAcrossIt) {
  Registered registered({0.05, 0.05});
  const Eigen::Matrix3d turn = geometry::rotation_from_vector({0.5, -0.6, 0.3});
  registered.found.world_from_model.rotation = turn.transpose();
  registered.found.world_from_model.translation = -(turn.transpose() * registered.model.centre);
  EXPECT_TRUE(registered.part());
}

TEST(UnexplainedPart, WhatAgreesALittleLessIsOfTheBone) { EXPECT_FALSE(Registered({0.5, 0.5}).part()); }

TEST(UnexplainedPart, APartThatAgreesBetterElsewhereHasMoved) {
  const auto part = Registered({0.4, 0.4}).part_if(0.7, 5);
  ASSERT_TRUE(part && part->alone);
  EXPECT_NEAR(part->alone->agreement, 0.7, 1e-9);
  EXPECT_NEAR(part->alone->moved_mm, 5, 1e-9);
  EXPECT_EQ(part->alone->refused, Reason::registration_ambiguous);
}

TEST(UnexplainedPart, APartThatAgreesNoBetterElsewhereIsHidden) {
  EXPECT_FALSE(Registered({0.4, 0.4}).part_if(0.45, 5));
}

TEST(UnexplainedPart, APartThatAgreesBetterNearlyThereHasNotMoved) {
  EXPECT_FALSE(Registered({0.4, 0.4}).part_if(0.7, 0.5));
}

TEST(UnexplainedPart, AFewPlacesThatAgreeElsewhereMayDoSoByChance) {
  EXPECT_FALSE(Registered({0.4, 0.4}).part_if(0.7, 5, 3));
}

TEST(UnexplainedPart, LittleWeightTellsNothing) {
  Registered registered({0.05, 0.05});
  for (RegisteredView& view : registered.found.views)
    for (LocalAgreement& each : view.agreements)
      if (each.agreement < 0.5) each.weight = 0.05;
  EXPECT_FALSE(registered.part());
}

TEST(UnexplainedPart, OneViewIsNotEnough) {
  Registered registered({0.05, 0.05});
  registered.views.pop_back();
  registered.found.views.pop_back();
  EXPECT_FALSE(registered.part());
}

}  // namespace unexplained_test
}  // namespace helicarm::registration
