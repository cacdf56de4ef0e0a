// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gui/controller/controller_fixtures_test.h"
#include "gui/controller/model_landmarks.h"
#include "gui/controller/stale.h"
#include "gui/controller/steps.h"
#include "gui/controller/unsaved_changes.h"
#include "helicarm/case_registration/plan.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::gui {
namespace fs = std::filesystem;
namespace landmarks_test {

using testing::HasSubstr;

const std::vector<pipeline::PointInModel> in_bone{
    {"tip", {-3.1, -2.2, 38}}, {"lateral, \"low\"", {29.3, 4, -26}}, {"medial", {-29, 14.5, 24.25}}};

class ControllerLandmarks : public ControllerWithModel {
 protected:
  ControllerLandmarks() {
    fs::copy(written_->path(), folder_.path(), fs::copy_options::recursive);
    open();
  }

  void open() {
    controller_ = std::make_unique<Controller>();
    QObject::connect(controller_.get(), &Controller::told, [this](const QString& words) { told_ << words; });
    QObject::connect(controller_.get(), &Controller::refused,
                     [this](Phase, const QString& why) { refused_ << why; });
    controller_->open_case(folder_.path());
    ASSERT_TRUE(idle());
    ASSERT_TRUE(state().measured);
  }
  void place(std::size_t count = 3) {
    for (std::size_t i = 0; i < count; ++i) controller_->place_landmarks(0, {in_bone[i]});
  }
  /// Where the views show the point of the bone.
  void pick(const pipeline::PointInModel& point) {
    for (const pipeline::ViewResult& view : state().result->views) {
      pipeline::Pick pick;
      pick.name = point.name;
      pick.view = view.name;
      pick.snap = pipeline::Snap::none;
      pick.uv_raw =
          view.rectification->map.raw_from_rectified(view.calibrated->view.project(truth_ * point.in_model));
      controller_->pick(pick);
    }
    ASSERT_TRUE(idle());
  }
  const case_registration::RegisteredModel& found() { return state().registration->models.at(0); }
  Json case_file() { return read_json(folder_.path() / "case.json").value(); }
  /// 80 mm beside the bone.
  void write_wrong_start() {
    Json json = case_file();
    json["models"][0]["start"]["world_from_model"][0][3] = truth_.translation.x() + 80;
    ASSERT_TRUE(write_file(folder_.path() / "case.json", to_text(json)));
    open();
  }

  QStringList told_, refused_;
};

TEST_F(ControllerLandmarks, ThreePickedOnesStartTheRegistrationInsteadOfAWrongStart) {
  write_wrong_start();
  place();
  EXPECT_EQ(state().landmarks.size(), 3U);  // to be clicked
  EXPECT_EQ(next_landmark(state())->point, "tip");
  for (const auto& point : in_bone) pick(point);
  EXPECT_THAT(landmark_start_words(state(), 0).toStdString(), HasSubstr("starts from its 3 landmarks"));
  ASSERT_TRUE(register_models());
  EXPECT_FALSE(found().registration.failure);
  EXPECT_EQ(found().used_landmarks.size(), 3U);
  EXPECT_LT((found().registration.world_from_model.translation - truth_.translation).norm(), 1);
}

TEST_F(ControllerLandmarks, WithFewerTheCasesStartIsUsedAndTheLackIsStated) {
  place();
  pick(in_bone[0]);
  pick(in_bone[2]);
  EXPECT_THAT(landmark_start_words(state(), 0).toStdString(),
              HasSubstr("bone: 2 of its placed landmarks are picked in two X-ray images, 1 more must be"));
  ASSERT_TRUE(register_models());
  EXPECT_TRUE(found().used_landmarks.empty());
  EXPECT_LT((found().registration.world_from_model.translation - truth_.translation).norm(), 1);
}

TEST_F(ControllerLandmarks, AModelMovedByHandStartsThere) {
  pipeline::Case the_case = pipeline::read_case(folder_.path()).value();
  for (const auto& point : in_bone)
    for (const char* view : {"AP", "LAT"}) {
      the_case.picks.emplace_back().name = point.name;
      the_case.picks.back().view = view;
    }
  start_from_landmarks(the_case, {in_bone}, {{the_case.models[0].name, {}}});
  EXPECT_TRUE(the_case.models[0].placed_landmarks.empty());
  EXPECT_TRUE(the_case.models[0].world_from_model);
  start_from_landmarks(the_case, {in_bone}, {});
  EXPECT_EQ(the_case.models[0].placed_landmarks.size(), 3U);
  EXPECT_FALSE(the_case.models[0].world_from_model);
}

TEST_F(ControllerLandmarks, UndoAndRedoReturnThem) {
  place();
  controller_->place_landmarks(0, {{"tip", {1, 2, 3}}});
  EXPECT_EQ(state().model_landmarks[0][0].in_model, Eigen::Vector3d(1, 2, 3));
  controller_->remove_landmark(0, "medial");
  EXPECT_EQ(state().model_landmarks[0].size(), 2U);
  EXPECT_EQ(state().landmarks.size(), 2U);
  controller_->undo();
  EXPECT_EQ(state().model_landmarks[0].size(), 3U);
  EXPECT_EQ(state().landmarks.size(), 3U);
  controller_->undo();
  EXPECT_EQ(state().model_landmarks[0][0].in_model, in_bone[0].in_model);
  while (controller_->can_undo()) controller_->undo();
  EXPECT_TRUE(state().model_landmarks[0].empty());
  EXPECT_TRUE(state().landmarks.empty());
  EXPECT_FALSE(fs::exists(folder_.path() / "unsaved_landmarks.json"));
  while (controller_->can_redo()) controller_->redo();
  EXPECT_EQ(state().model_landmarks[0].size(), 2U);
}

TEST_F(ControllerLandmarks, ARegistrationIsOutOfDateOnceOneMovesInTheModel) {
  place();
  for (const auto& point : in_bone) pick(point);
  ASSERT_TRUE(register_models());
  EXPECT_EQ(stale_model(state(), 0), "");
  controller_->place_landmarks(0, {{"tip", in_bone[0].in_model + Eigen::Vector3d(1, 0, 0)}});
  EXPECT_THAT(stale_model(state(), 0).toStdString(), HasSubstr("tip has been moved in the model"));
  EXPECT_EQ(steps_of(state())[std::size_t(Phase::registration)].status, StepStatus::stale);
  controller_->undo();
  EXPECT_EQ(stale_model(state(), 0), "");
  controller_->remove_landmark(0, "medial");
  EXPECT_THAT(stale_model(state(), 0).toStdString(), HasSubstr("medial"));
}

TEST_F(ControllerLandmarks, StartsOfOtherLandmarksAreNoLongerDisplayed) {
  place();
  for (const auto& point : in_bone) pick(point);
  controller_->place_models();
  ASSERT_TRUE(idle());
  ASSERT_TRUE(state().at_starts);
  controller_->place_landmarks(0, {{"tip", in_bone[0].in_model + Eigen::Vector3d(1, 0, 0)}});
  EXPECT_FALSE(state().at_starts);
}

TEST_F(ControllerLandmarks, SavedOnesAreTheStartOfTheCase) {
  place();
  for (const auto& point : in_bone) pick(point);
  EXPECT_EQ(unsaved_changes(state()).words(), "the picks, the landmarks of bone");
  EXPECT_EQ(unsaved_changes(state()).files().size(), 2);
  EXPECT_TRUE(fs::exists(folder_.path() / "unsaved_landmarks.json"));
  controller_->save_picks();
  EXPECT_FALSE(unsaved_changes(state()).any());
  EXPECT_FALSE(fs::exists(folder_.path() / "unsaved_landmarks.json"));
  EXPECT_THAT(told_.back().toStdString(), HasSubstr("replace its \"world_from_model\""));
  const pipeline::Case the_case = pipeline::read_case(folder_.path()).value();
  EXPECT_FALSE(the_case.models[0].world_from_model);
  EXPECT_EQ(the_case.models[0].landmarks->filename(), "bone-landmarks.csv");
  const auto read = case_registration::start_landmarks(the_case.models[0]);
  ASSERT_EQ(read.size(), in_bone.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].name, in_bone[i].name);
    EXPECT_EQ(read[i].in_model, in_bone[i].in_model);
  }
  open();
  EXPECT_EQ(state().model_landmarks[0].size(), 3U);
  EXPECT_FALSE(controller_->can_undo());
}

TEST_F(ControllerLandmarks, FewerThanThreePickedOnesAreKeptBesideTheCase) {
  const Json before = case_file()["models"];
  place(2);
  EXPECT_FALSE(unsaved_changes(state()).can_be_saved());
  EXPECT_EQ(unsaved_changes(state()).files(), QStringList("unsaved_landmarks.json"));
  controller_->save_picks();
  EXPECT_EQ(case_file()["models"], before);
  EXPECT_TRUE(told_.back().startsWith("The landmarks of bone are not its start yet")) << "no pick is saved";
  open();  // as after a crash
  ASSERT_EQ(state().model_landmarks[0].size(), 2U);
  EXPECT_EQ(state().model_landmarks[0][1].in_model, in_bone[1].in_model);
  EXPECT_EQ(state().landmarks.size(), 2U);
  EXPECT_EQ(unsaved_changes(state()).not_yet.size(), 1);
  EXPECT_THAT(told_.back().toStdString(), HasSubstr("are restored"));
  controller_->undo();
  EXPECT_TRUE(state().model_landmarks[0].empty());
  EXPECT_FALSE(unsaved_changes(state()).any());
}

TEST_F(ControllerLandmarks, AnUnreadableFileOfUnsavedOnesIsNamedAndKept) {
  const fs::path file = folder_.path() / "unsaved_landmarks.json";
  ASSERT_TRUE(write_file(file, "[{"));
  open();
  ASSERT_TRUE(state().picks_not_kept);
  EXPECT_THAT(state().picks_not_kept->message, HasSubstr("unsaved_landmarks.json"));
  place();
  EXPECT_EQ(*read_file(file, 100), "[{");
}

TEST_F(ControllerLandmarks, NamesAreCheckedAndChanged) {
  place();
  EXPECT_TRUE(refused_.isEmpty());
  controller_->place_landmarks(0, {{"", {}}});
  EXPECT_EQ(refused_.size(), 1);
  controller_->place_landmarks(
      0, {{state().calibrator.targets.empty() ? "" : state().calibrator.targets[0].name, {}}});
  EXPECT_EQ(refused_.size(), 2);
  controller_->rename_landmark(0, "tip", "medial");
  EXPECT_EQ(refused_.size(), 3);
  EXPECT_EQ(state().model_landmarks[0].size(), 3U);
  pick(in_bone[0]);
  controller_->rename_landmark(0, "tip", "apex");
  ASSERT_TRUE(idle());
  EXPECT_EQ(state().model_landmarks[0][0].name, "apex");
  EXPECT_EQ(views_with(state().picks, "apex"), 2);
  EXPECT_EQ(views_with(state().picks, "tip"), 0);
  EXPECT_EQ(state().landmarks.front(), "apex");
  EXPECT_EQ(free_landmark_name(state(), 0, "L"), "L1");
  controller_->add_landmark("L1");
  EXPECT_EQ(free_landmark_name(state(), 0, "L"), "L2");
}

TEST(ModelLandmarks, AFilesNameIsSafe) {
  const TemporaryFolder folder;
  Json json = Json::parse(R"({"format": "helicarm-case/2", "calibrator": "udcsc",
      "views": [{"name": "A", "image": "a.png"}, {"name": "B", "image": "b.png"}],
      "models": [{"name": "../a b", "surface": "f.stl"}, {"name": "../a/b", "surface": "f.stl"}]})");
  ASSERT_TRUE(write_file(folder.path() / "case.json", to_text(json)));
  const auto the_case = pipeline::case_from_json(json, "case.json", folder.path());
  ASSERT_TRUE(the_case) << the_case.error().message;
  std::vector<pipeline::Pick> picks;
  for (const auto& point : in_bone)
    for (const char* view : {"A", "B"}) {
      picks.emplace_back().name = point.name;
      picks.back().view = view;
    }
  {
    const TemporaryFolder both;  // of one file name, saved together
    ASSERT_TRUE(write_file(both.path() / "case.json", to_text(json)));
    ASSERT_TRUE(save_landmarks(both.path(), the_case->models, {in_bone, in_bone}, {{}, {}}, picks));
    const auto read = pipeline::read_case(both.path());
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_NE(read->models[0].landmarks, read->models[1].landmarks);
  }
  const auto saved = save_landmarks(folder.path(), the_case->models, {in_bone, {}}, {{}, {}}, picks);
  ASSERT_TRUE(saved) << saved.error().message;
  EXPECT_EQ(saved->told.size(), 1);
  const auto again = pipeline::read_case(folder.path());
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->models[0].landmarks->parent_path(), folder.path());
  EXPECT_TRUE(fs::exists(*again->models[0].landmarks));
  EXPECT_FALSE(again->models[1].landmarks);

  // The same model again, then one of the same file name.
  const auto other = save_landmarks(folder.path(), the_case->models,
                                    {{in_bone[1], in_bone[0], in_bone[2]}, in_bone}, {in_bone, {}}, picks);
  ASSERT_TRUE(other) << other.error().message;
  const auto both = pipeline::read_case(folder.path()).value();
  EXPECT_EQ(both.models[0].landmarks, again->models[0].landmarks);
  EXPECT_NE(both.models[0].landmarks, both.models[1].landmarks);
  EXPECT_EQ(case_registration::start_landmarks(both.models[0])[0].name, in_bone[1].name);
  EXPECT_EQ(case_registration::start_landmarks(both.models[1])[0].name, in_bone[0].name);
}

}  // namespace landmarks_test
}  // namespace helicarm::gui
