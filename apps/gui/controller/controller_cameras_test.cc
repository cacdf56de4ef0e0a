// SPDX-License-Identifier: Apache-2.0
// A case whose views bring cameras of another program, in place of a calibrator.
#include <cmath>

#include <gmock/gmock.h>

#include "gui/controller/case_with_cameras_test.h"
#include "gui/controller/controller_fixtures_test.h"
#include "gui/controller/stale.h"
#include "gui/controller/steps.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/pipeline/case_purpose.h"

namespace helicarm::gui {
namespace cameras_test {

namespace fs = std::filesystem;
using testing::HasSubstr;

class ControllerCameras : public ControllerFixture<QGuiApplication> {
 protected:
  static void SetUpTestSuite() {
    written_ = std::make_unique<TemporaryFolder>();
    truth_ = write_case_with_cameras(written_->path());
  }
  static void TearDownTestSuite() { written_.reset(); }

  ControllerCameras() {
    fs::copy(written_->path(), the_case(), fs::copy_options::recursive);
    QObject::connect(controller_.get(), &Controller::refused,
                     [this](Phase, const QString& why) { refused_ = why.toStdString(); });
    QObject::connect(controller_.get(), &Controller::told,
                     [this](const QString& words) { told_ = words.toStdString(); });
  }

  fs::path the_case() const { return folder_.path() / "case"; }
  void open(bool keeps_picks = false) {
    controller_->open_case(the_case(), keeps_picks);
    ASSERT_TRUE(idle());
    ASSERT_TRUE(state().measured) << observed();
  }
  StepCard card(Phase phase) { return steps_of(state())[std::size_t(phase)]; }
  pipeline::Case read() const { return pipeline::read_any_case(the_case()).value(); }

  /// In all views.
  void pick(const std::string& name, const Eigen::Vector3d& in_world) {
    for (std::size_t i = 0; i < state().views.size(); ++i) {
      pipeline::Pick pick;
      pick.name = name;
      pick.view = state().views[i];
      pick.uv_raw = exchange::import_matrix(state().cameras[i])->view.project(in_world);
      controller_->pick(pick);
      ASSERT_TRUE(idle());
    }
  }

  /// What `helicarm register` says of the case; empty if it accepts it.
  std::string refusal_of_the_command() const {
    const auto registered =
        pipeline::read_case(the_case(), pipeline::Purpose::registration)
            .and_then([](const pipeline::Case& read) { return case_registration::register_case(read, {}); });
    return registered ? std::string() : registered.error().message;
  }
  void expect_the_commands_refusal(const char* words) {
    controller_->open_case(the_case(), false);
    ASSERT_TRUE(idle());
    ASSERT_TRUE(state().refusals.contains(Phase::acquire)) << words;
    const std::string& message = state().refusals.at(Phase::acquire).message;
    EXPECT_THAT(message, HasSubstr(words));
    EXPECT_EQ(message, refusal_of_the_command());
  }
  void change_case(const std::function<void(Json&)>& change) const {
    Json json = read_json(the_case() / "case.json").value();
    change(json);
    ASSERT_TRUE(write_file(the_case() / "case.json", to_text(json)));
  }

  static inline std::unique_ptr<TemporaryFolder> written_;
  static inline geometry::RigidTransform truth_;
  std::string refused_, told_;
};

TEST_F(ControllerCameras, ItOpensWithoutACalibratorAndSaysWhatItsCamerasLack) {
  open();
  EXPECT_EQ(state().cameras.size(), 2u);
  for (const pipeline::ViewResult& view : state().result->views) EXPECT_TRUE(view.xray_image);
  EXPECT_EQ(card(Phase::rectify).figure, "taken as undistorted");
  EXPECT_EQ(card(Phase::calibrate).figure, "cameras given");
  EXPECT_EQ(card(Phase::calibrate).status, StepStatus::warning);
  EXPECT_THAT(card(Phase::calibrate).why.toStdString(), HasSubstr("AP, LAT: the cameras come without"));
  EXPECT_THAT(card(Phase::calibrate).why.toStdString(), HasSubstr("covariance_missing"));
}

TEST_F(ControllerCameras, ItsModelsAreRegisteredAsByTheCommand) {
  open();
  ASSERT_TRUE(register_models());
  const auto command = case_registration::register_case(read(), {});
  ASSERT_TRUE(command) << command.error().message;
  Json shown = case_registration::to_json(*state().registration), said = case_registration::to_json(*command);
  for (Json* each : {&shown, &said})
    for (Json& model : (*each)["models"]) model.erase("seconds");
  EXPECT_EQ(shown, said);
  const registration::Registration& bone = state().registration->models[0].registration;
  EXPECT_EQ(bone.decision, registration::Decision::warn);
  EXPECT_EQ(bone.warnings.front().reason, Reason::covariance_missing);
  EXPECT_LT((bone.world_from_model.translation - truth_.translation).norm(), 0.5);
}

TEST_F(ControllerCameras, AModelThatIsMovedByHandIsRegisteredFromThere) {
  open();
  ASSERT_TRUE(register_models());
  registration::RigidStep step = registration::RigidStep::Zero();
  step.tail<3>() << 3, 0, 0;
  controller_->nudge(0, step);
  ASSERT_TRUE(idle());
  EXPECT_EQ(card(Phase::registration).status, StepStatus::stale);
  ASSERT_TRUE(register_models());
  EXPECT_FALSE(state().nudged);
  EXPECT_LT(
      (state().registration->models[0].registration.world_from_model.translation - truth_.translation).norm(),
      0.5);
}

TEST_F(ControllerCameras, PicksAreLocatedByTheCamerasAndStateNoError) {
  open();
  const Eigen::Vector3d at = truth_ * Eigen::Vector3d(0, 0, 10);
  controller_->add_landmark("L1");
  pick("L1", at);
  ASSERT_EQ(state().result->points.size(), 1u);
  const pipeline::PointResult& point = state().result->points[0];
  ASSERT_TRUE(point.place) << observed();
  EXPECT_LT((point.place->in_calibrator - at).norm(), 1e-3);
  EXPECT_TRUE(std::isnan(point.place->covariance_in_calibrator(0, 0)));
  EXPECT_EQ(card(Phase::plan).figure, "errors not known");
  EXPECT_EQ(card(Phase::plan).status, StepStatus::warning);
  EXPECT_THAT(card(Phase::plan).why.toStdString(), HasSubstr("covariance_missing"));
}

TEST_F(ControllerCameras, PicksAndLandmarksInTheModelAreSavedAndStartTheRegistration) {
  open(true);
  std::vector<pipeline::PointInModel> points;
  for (const Eigen::Vector3d& at :
       {Eigen::Vector3d(-10, -8, -30), Eigen::Vector3d(12, 0, -25), Eigen::Vector3d(0, 10, 30)})
    points.push_back({"L" + std::to_string(points.size() + 1), at});
  controller_->place_landmarks(0, points);
  for (const pipeline::PointInModel& point : points) pick(point.name, truth_ * point.in_model);
  ASSERT_TRUE(register_models());
  EXPECT_EQ(state().registration->models[0].used_landmarks.size(), 3u);
  controller_->save_picks();
  ASSERT_FALSE(state().picks_not_kept) << state().picks_not_kept->message;
  const pipeline::Case saved = read();
  EXPECT_EQ(saved.picks.size(), 6u);
  EXPECT_TRUE(saved.models[0].landmarks);
  EXPECT_EQ(refusal_of_the_command(), "");
}

TEST_F(ControllerCameras, TheExportIsThatOfTheCommand) {
  open();
  const fs::path out = folder_.path() / "out";
  controller_->export_to(out);
  EXPECT_THAT(refused_, HasSubstr("register the models first"));
  EXPECT_FALSE(fs::exists(out));
  ASSERT_TRUE(register_models());
  controller_->export_to(out);
  ASSERT_TRUE(idle());
  ASSERT_TRUE(state().exported) << observed();
  for (const char* file : {"registration.json", "report.html", "AP_overlay.png", "LAT_overlay.png"})
    EXPECT_TRUE(fs::exists(out / file)) << file;
  EXPECT_FALSE(fs::exists(out / "result.json")) << "nothing is calibrated";
  EXPECT_EQ(read_json(out / "registration.json").value(),
            Json::parse(to_text(case_registration::to_json(*state().registration))));
}

TEST_F(ControllerCameras, AnExportSaysThatLocatedPointsAreNotInIt) {
  open();
  EXPECT_EQ(lacks_of_export(state()), QStringList{"the models are not registered"});
  controller_->add_landmark("L1");
  pick("L1", truth_ * Eigen::Vector3d(0, 0, 10));
  EXPECT_THAT(lacks_of_export(state()).join('\n').toStdString(), HasSubstr("helicarm locate"));
}

TEST_F(ControllerCameras, ACameraOfOneViewOnlyIsRefusedAsByTheCommand) {
  change_case([](Json& json) {
    json["views"][1].erase("camera");
    json["calibrator"] = "udcsc";
  });
  expect_the_commands_refusal("camera");
}

TEST_F(ControllerCameras, AnUnreadableCameraIsRefusedAsByTheCommand) {
  ASSERT_TRUE(write_file(the_case() / "LAT.json", "{\"K\": 7}"));
  expect_the_commands_refusal("LAT.json");
}

TEST_F(ControllerCameras, ACameraOfAnotherImageSizeIsRefusedAsByTheCommand) {
  Json camera = read_json(the_case() / "LAT.json").value();
  camera["image_size"] = {300, 400};
  ASSERT_TRUE(write_file(the_case() / "LAT.json", to_text(camera)));
  expect_the_commands_refusal("LAT: the camera is for 300 x 400 pixels, the image has 512 x 512");
}

TEST_F(ControllerCameras, ACaseOfFramesIsRefusedAsByTheCommand) {
  change_case([](Json& json) { json["views"][0]["image"] = "ap_{frame:03d}.dcm"; });
  expect_the_commands_refusal("name the frames with --frames");
}

TEST_F(ControllerCameras, AChangedCameraPutsEveryStepOutOfDate) {
  open();
  ASSERT_TRUE(write_file(the_case() / "AP.json", read_file(the_case() / "AP.json", 10000).value() + " "));
  ASSERT_TRUE(wait("the change is noticed", [&] { return !state().changed_file.empty(); }));
  EXPECT_EQ(card(Phase::calibrate).status, StepStatus::stale);
}

}  // namespace cameras_test
}  // namespace helicarm::gui
