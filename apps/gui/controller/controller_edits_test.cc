// SPDX-License-Identifier: Apache-2.0
// What of a person's changes can be saved, undone and redone.
#include "gui/controller/controller_fixtures_test.h"
#include "gui/controller/stale.h"

namespace helicarm::gui {
namespace {

class ControllerEdits : public ControllerWithModel {
 protected:
  void open(const std::filesystem::path& folder, bool keeps_picks) {
    controller_->open_case(folder, keeps_picks);
    ASSERT_TRUE(idle());
    ASSERT_TRUE(state().measured);
  }
  void move_by(double mm, std::size_t model = 0) {
    registration::RigidStep step = registration::RigidStep::Zero();
    step[3] = mm;
    controller_->nudge(model, step);
  }
  void choose(std::size_t model) { controller_->nudge(model, registration::RigidStep::Zero()); }
  /// The bone twice.
  void open_with_two_models() {
    write_case_with_model(folder_.path());
    Json again = read_json(folder_.path() / "case.json").value()["models"][0];
    again["name"] = "again";
    again.erase("plan");
    ASSERT_NO_FATAL_FAILURE(open_with(again));
  }
  void open_with(const Json& model) {
    Json json = read_json(folder_.path() / "case.json").value();
    json["models"].push_back(model);
    ASSERT_TRUE(write_file(folder_.path() / "case.json", to_text(json)));
    ASSERT_NO_FATAL_FAILURE(open(folder_.path(), false));
  }
  bool place() {
    controller_->place_models();
    return idle() && state().at_starts;
  }
  const case_registration::RegisteredModel& at_start(std::size_t model) {
    return state().at_starts->models.at(model);
  }
};

TEST_F(ControllerEdits, SavingDuringARegistrationIsRefusedWithTheReason) {
  write_case_with_model(folder_.path());
  ASSERT_NO_FATAL_FAILURE(open(folder_.path(), true));
  controller_->pick({.name = "epicondyle", .view = state().views.front(), .uv_raw = {100, 120}});
  ASSERT_TRUE(idle());
  ASSERT_TRUE(state().has_unsaved_picks);
  QStringList told;
  QObject::connect(controller_.get(), &Controller::told, [&](const QString& words) { told << words; });
  controller_->register_models();
  controller_->save_picks();
  EXPECT_EQ(told.filter("Nothing is saved during other work").size(), 1);
  EXPECT_TRUE(state().has_unsaved_picks);
  ASSERT_TRUE(idle());
  controller_->save_picks();
  EXPECT_EQ(told.filter("The picks are saved").size(), 1);
  EXPECT_FALSE(state().has_unsaved_picks);
}

TEST_F(ControllerEdits, AMeasurementWithOtherSettingsEndsTheMovesFromPosesBefore) {
  ASSERT_NO_FATAL_FAILURE(open(written_->path(), false));
  ASSERT_TRUE(register_models());
  controller_->add_landmark("epicondyle");
  move_by(1);
  move_by(2);
  controller_->undo();
  ASSERT_TRUE(controller_->can_redo());
  case_registration::RegisterOptions options;
  options.run.motion_sigma_mm = 0.5;
  controller_->set_options(options);
  ASSERT_TRUE(idle());
  EXPECT_FALSE(controller_->can_redo());
  EXPECT_EQ(controller_->undoes(), "landmark epicondyle");
  controller_->undo();
  EXPECT_FALSE(controller_->can_undo());
}

TEST_F(ControllerEdits, AMeasurementWithOtherSettingsEndsTheStartsByHandOfPosesBefore) {
  ASSERT_NO_FATAL_FAILURE(open(written_->path(), false));
  ASSERT_TRUE(register_models());
  move_by(1);
  ASSERT_TRUE(register_models());
  ASSERT_EQ(state().starts_by_hand.size(), 1u);
  controller_->add_landmark("epicondyle");
  case_registration::RegisterOptions options;
  options.run.motion_sigma_mm = 0.5;
  controller_->set_options(options);
  ASSERT_TRUE(idle());
  controller_->undo();
  EXPECT_TRUE(state().landmarks.empty());
  EXPECT_TRUE(state().starts_by_hand.empty());
}

TEST_F(ControllerEdits, AModelPlacedByHandStaysWhileAnotherIsPlacedAndBothStartThere) {
  ASSERT_NO_FATAL_FAILURE(open_with_two_models());
  ASSERT_TRUE(place());
  const geometry::RigidTransform start = at_start(0).registration.world_from_model;
  const auto outlines = at_start(0).outlines;
  move_by(3);
  const geometry::RigidTransform placed = state().nudged->world_from_model;
  choose(1);
  EXPECT_FALSE(state().nudged);
  EXPECT_TRUE(is_placed(state(), 0));
  EXPECT_FALSE(is_placed(state(), 1));
  EXPECT_EQ(at_start(0).registration.world_from_model.translation, placed.translation);
  move_by(2, 1);
  EXPECT_EQ(controller_->undoes(), "move of again");
  ASSERT_TRUE(wait("both outlines follow", [&] {
    return !at_start(0).outlines.empty() && at_start(0).outlines != outlines &&
           state().nudged->outlines != at_start(1).outlines;
  }));

  controller_->undo();
  EXPECT_FALSE(state().nudged);
  EXPECT_TRUE(is_placed(state(), 0));
  EXPECT_EQ(controller_->undoes(), "move of bone");
  controller_->undo();
  EXPECT_FALSE(is_placed(state(), 0));
  EXPECT_EQ(at_start(0).registration.world_from_model.translation, start.translation);
  controller_->redo();
  controller_->redo();
  ASSERT_TRUE(register_models());
  ASSERT_EQ(state().starts_by_hand.size(), 2u);
  EXPECT_EQ(state().starts_by_hand[0].world_from_model.translation, placed.translation);
}

TEST_F(ControllerEdits, ModelsPlacedByHandReturnToTheStartsOfTheCase) {
  ASSERT_NO_FATAL_FAILURE(open_with_two_models());
  ASSERT_TRUE(place());
  move_by(3);
  choose(1);
  move_by(2, 1);
  controller_->return_models();
  EXPECT_FALSE(has_poses_by_hand(state()));
  EXPECT_FALSE(state().at_starts);
  controller_->undo();
  EXPECT_TRUE(is_placed(state(), 0));
  EXPECT_TRUE(is_moved(state(), 1));
}

TEST_F(ControllerEdits, AModelOfLandmarksAloneIsNotMoved) {
  write_case_with_model(folder_.path());
  ASSERT_TRUE(write_file(folder_.path() / "points.csv", "name,x_mm,y_mm,z_mm\na,0,0,0\nb,9,0,0\nc,0,9,0\n"));
  ASSERT_NO_FATAL_FAILURE(open_with({{"name", "points"}, {"start", {{"landmarks", "points.csv"}}}}));
  ASSERT_TRUE(place());
  move_by(3, 1);
  EXPECT_FALSE(state().nudged);
  EXPECT_FALSE(controller_->can_undo());
}

TEST_F(ControllerEdits, AfterARegistrationTheModelThatReturnsIsNamed) {
  ASSERT_NO_FATAL_FAILURE(open_with_two_models());
  ASSERT_TRUE(register_models());
  move_by(3);
  choose(1);
  EXPECT_FALSE(state().nudged);
  EXPECT_EQ(controller_->undoes(), "move of bone");
}

TEST_F(ControllerEdits, APickEndsTheDisplayOfStartsUnlessAModelIsPlaced) {
  ASSERT_NO_FATAL_FAILURE(open(written_->path(), false));
  const pipeline::Pick pick{.name = "epicondyle", .view = state().views.front(), .uv_raw = {100, 120}};
  ASSERT_TRUE(place());
  controller_->pick(pick);
  ASSERT_TRUE(idle());
  EXPECT_FALSE(state().at_starts);
  ASSERT_TRUE(place());
  EXPECT_FALSE(has_old_starts(state()));
  move_by(3);
  controller_->clear_picks();
  ASSERT_TRUE(idle());
  EXPECT_TRUE(state().at_starts);
  EXPECT_TRUE(has_old_starts(state()));
  controller_->undo();
  ASSERT_TRUE(idle());
  EXPECT_TRUE(state().at_starts);
  EXPECT_FALSE(has_old_starts(state()));
}

}  // namespace
}  // namespace helicarm::gui
