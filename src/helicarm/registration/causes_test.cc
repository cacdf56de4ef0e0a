// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/causes.h"

#include <gmock/gmock.h>

#include "helicarm/registration/scene_test.h"

namespace helicarm::registration {
namespace causes_test {

using testing::HasSubstr, testing::IsEmpty, testing::SizeIs;

Model bone() { return *model_from("bone", lopsided_bone(), std::nullopt, HuWindow{150, 3000}); }

/// As of a registration that ended at the true pose, refused or not; its views show no comparisons.
Registration registration_of(const Model& model, bool refused) {
  Registration result;
  result.name = model.name;
  result.world_from_model = true_pose();
  result.centre = true_pose() * model.centre;
  for (const char* name : {"AP", "LAT"}) result.views.emplace_back().name = name;
  if (refused) result.failure = Failure{Reason::wrong_model, "refused"};
  return result;
}

/// Black below the image's row 80, on which the model's centre lies.
void crop(RegistrationView& view) {
  for (int v = 80; v < view.grey.height(); ++v)
    for (int u = 0; u < view.grey.width(); ++u) view.grey(u, v) = 0;
}

TEST(CausesOf, AFieldThatShowsHalfOfTheModelIsNamed) {
  const Model model = bone();
  auto views = two_views(lopsided_bone());
  crop(views[1]);
  const auto notes = causes_of(model, views, registration_of(model, true), nullptr);
  ASSERT_THAT(notes, SizeIs(1));
  EXPECT_EQ(notes[0].reason, Reason::wrong_model);
  EXPECT_EQ(notes[0].view, "LAT");
  EXPECT_NEAR(notes[0].figures.at("outside_share"), 0.5, 0.1);
  EXPECT_THAT(notes[0].message, HasSubstr("of the model lies outside the field of LAT"));
}

TEST(CausesOf, PixelsOnFiducialsAreWithinTheField) {
  const Model model = bone();
  auto views = two_views(lopsided_bone());
  views[0].usable = image::Image<std::uint8_t>(160, 160, 0);
  EXPECT_THAT(causes_of(model, views, registration_of(model, true), nullptr), IsEmpty());
}

TEST(CausesOf, WhatIsNotRefusedHasNone) {
  const Model model = bone();
  auto views = two_views(lopsided_bone());
  for (RegistrationView& view : views) crop(view);
  EXPECT_THAT(causes_of(model, views, registration_of(model, false), nullptr), IsEmpty());
}

TEST(CausesOf, ARefusedRegistrationHasThemInItsNotes) {
  const Model model = bone();
  auto views = two_views(lopsided_bone());
  for (RegistrationView& view : views) crop(view);
  RegistrationOptions options;
  options.threads = 1;
  options.search = {2, 2, 10};
  options.search.anywhere_after_refusal = false;
  options.max_error_mm = 1e-3;
  const auto result = register_model(model, views, {true_pose()}, options);
  ASSERT_TRUE(result.failure);
  EXPECT_THAT(result.notes, SizeIs(2));
}

}  // namespace causes_test
}  // namespace helicarm::registration
