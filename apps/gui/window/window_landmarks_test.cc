// SPDX-License-Identifier: Apache-2.0
// Landmarks placed in a model: in slices, on its surface, and by proposal.
#include <QElapsedTimer>
#include <QMessageBox>
#include <QStatusBar>
#include <QTableWidget>

#include "gui/controller/case_with_model_test.h"
#include "gui/window/landmarks_window.h"
#include "gui/window/legibility_test.h"
#include "gui/window/window_test.h"

namespace helicarm::gui {
namespace landmarks_window_test {

class WindowLandmarks : public Window {
 protected:
  void open() {
    write_case_with_model(folder_ / "case");
    window_->open_paths({folder_ / "case"});
    ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
    click("modelLandmarks");  // before any registration
    ASSERT_TRUE(wait("the model is read", [&] { return dialog() && !dialog()->is_busy(); }));
    ASSERT_TRUE(dialog()->surface().mesh) << says();
  }
  LandmarksWindow* dialog() { return window_->findChild<LandmarksWindow*>("landmarks"); }
  template <class Part>
  Part* part(const char* name) {
    auto* found = dialog()->findChild<Part*>(name);
    EXPECT_NE(found, nullptr) << name;
    return found;
  }
  std::string says() { return part<QLabel>("landmarksSay")->text().toStdString(); }
  QString cell(int row, int column) {
    return part<QTableWidget>("modelLandmarkTable")->item(row, column)->text();
  }
  void press(const char* name) { QTest::mouseClick(part<QPushButton>(name), Qt::LeftButton); }
  void click_surface(const QPointF& at) {
    QTest::mouseClick(part<SurfaceView>("modelSurface"), Qt::LeftButton, {}, at.toPoint());
  }
};

TEST_F(WindowLandmarks, AClickOnTheSurfaceAndInASlicePlacesTheCursor) {
  ASSERT_NO_FATAL_FAILURE(open());
  auto* surface = part<SurfaceView>("modelSurface");
  const phantom::TriangleMesh& mesh = *dialog()->surface().mesh;
  EXPECT_FALSE(part<QPushButton>("addModelLandmark")->isEnabled());  // without a cursor
  int clicked = 0;
  for (std::size_t i = 0; i < mesh.triangles.size(); i += mesh.triangles.size() / 400) {
    const auto& [a, b, c] = mesh.triangles[i];
    const Eigen::Vector3d place = (mesh.corners[a] + mesh.corners[b] + mesh.corners[c]) / 3;
    const Eigen::Vector3d across =
        (mesh.corners[b] - mesh.corners[a]).cross(mesh.corners[c] - mesh.corners[a]).normalized();
    // Seen from the front, not obliquely: a click is a whole px.
    if (across.y() > -0.9 || !surface->shows(place)) continue;
    click_surface(surface->place_of(place));
    ASSERT_TRUE(dialog()->cursor());
    EXPECT_LT((*dialog()->cursor() - place).norm(), 0.5) << place.transpose();
    ++clicked;
  }
  EXPECT_GT(clicked, 5);
  const auto before = dialog()->cursor();
  click_surface({1, 1});  // beside it
  EXPECT_EQ(dialog()->cursor(), before);

  auto* slice = part<SliceView>("slice2");
  QTest::mouseClick(slice, Qt::LeftButton, {}, slice->place_of({30, 25, 0}).toPoint());
  const Eigen::Vector3d in_bone = dialog()->slices().ct->patient_from_voxel * Eigen::Vector3d(30, 25, 0);
  EXPECT_NEAR(dialog()->cursor()->x(), in_bone.x(), 0.6);
  EXPECT_NEAR(dialog()->cursor()->y(), in_bone.y(), 0.6);
  EXPECT_NEAR(dialog()->cursor()->z(), before->z(), 1e-9);
}

TEST_F(WindowLandmarks, LandmarksAreAddedMovedRenamedAndRemoved) {
  ASSERT_NO_FATAL_FAILURE(open());
  auto* surface = part<SurfaceView>("modelSurface");
  const QPointF middle(0.5 * surface->width(), 0.5 * surface->height());
  click_surface(middle);
  EXPECT_EQ(part<QLineEdit>("modelLandmarkName")->text(), "L1");
  press("addModelLandmark");
  ASSERT_EQ(state().model_landmarks[0].size(), 1U);
  EXPECT_EQ(state().model_landmarks[0][0].in_model, *dialog()->cursor());
  EXPECT_EQ(cell(0, 0), "L1");
  EXPECT_EQ(cell(0, 4), "0 of 2 views");
  EXPECT_EQ(part<QLineEdit>("modelLandmarkName")->text(), "L2");
  EXPECT_EQ(state().landmarks, std::vector<std::string>{"L1"});
  EXPECT_THAT(says(), HasSubstr("Place landmarks"));

  surface->setFocus();
  QTest::keyClick(surface, Qt::Key_Right);
  QTest::keyClick(surface, Qt::Key_Return);
  part<QTableWidget>("modelLandmarkTable")->selectRow(0);
  EXPECT_EQ(*dialog()->cursor(), state().model_landmarks[0][0].in_model);  // shows it
  QTest::keyClick(surface, Qt::Key_Return);
  press("moveModelLandmark");
  EXPECT_EQ(state().model_landmarks[0][0].in_model, *dialog()->cursor());
  part<QLineEdit>("modelLandmarkName")->setText("epicondyle");
  press("renameModelLandmark");
  EXPECT_EQ(cell(0, 0), "epicondyle");
  QTest::keyClick(part<QLineEdit>("modelLandmarkName"), Qt::Key_Return);  // of the same name
  EXPECT_THAT(says(), HasSubstr("already"));
  EXPECT_EQ(state().model_landmarks[0].size(), 1U);
  press("removeModelLandmark");
  EXPECT_EQ(part<QTableWidget>("modelLandmarkTable")->rowCount(), 0);
  window_->controller().undo();
  EXPECT_EQ(part<QTableWidget>("modelLandmarkTable")->rowCount(), 1);
}

TEST_F(WindowLandmarks, ProposedOnesAreTipsAndTheWindowSaysWhatComesNext) {
  ASSERT_NO_FATAL_FAILURE(open());
  press("proposeLandmarks");
  const auto& placed = state().model_landmarks[0];
  ASSERT_GE(placed.size(), 3U);
  EXPECT_EQ(placed[0].name, "L1");
  EXPECT_THAT(says(), HasSubstr("Click L1 in two X-ray images on page Plan"));
  EXPECT_THAT(find<QLabel>("registerSays")->text().toStdString(), HasSubstr("3 more must be"));
  screenshot("landmarks", dialog());
  EXPECT_EQ(illegible_parts(*dialog()).join('\n').toStdString(), "");
  press("proposeLandmarks");
  EXPECT_THAT(says(), HasSubstr("landmarks already"));
  EXPECT_EQ(window_->controller().undoes(), QString("%1 landmarks").arg(placed.size()));
  press("closeLandmarks");
  ASSERT_TRUE(wait("it is closed", [&] { return dialog() == nullptr; }));
}

TEST_F(WindowLandmarks, AFileThatCannotBeReadIsNamedAndAnotherCaseClosesTheWindow) {
  write_case_with_model(folder_ / "case");
  ASSERT_TRUE(write_file(folder_ / "case" / "ct.nrrd", "NRRD0004\n"));
  window_->open_paths({folder_ / "case"});
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  click("modelLandmarks");
  ASSERT_TRUE(wait("the model is read", [&] { return dialog() && !dialog()->is_busy(); }));
  EXPECT_THAT(says(), HasSubstr("ct.nrrd"));
  EXPECT_FALSE(part<QPushButton>("proposeLandmarks")->isEnabled());
  window_->controller().open_images({});
  ASSERT_TRUE(wait("it is closed", [&] { return dialog() == nullptr; }));
}

TEST_F(WindowLandmarks, ClosingOffersToSaveWhatCanBeSavedAndSaysWhyNotTheRest) {
  ASSERT_NO_FATAL_FAILURE(open());
  press("proposeLandmarks");
  press("closeLandmarks");
  const std::string unsaved = find<QLabel>("unsavedPicks")->text().toStdString();
  EXPECT_THAT(unsaved, HasSubstr("landmarks of bone are not its start yet, since 0 of them"));
  EXPECT_THAT(unsaved, testing::Not(HasSubstr("the picks")));
  const auto asked = [&] { return window_->findChild<QMessageBox*>("unsavedQuestion"); };
  EXPECT_FALSE(window_->close());
  ASSERT_NE(asked(), nullptr);
  EXPECT_THAT(asked()->text().toStdString(), HasSubstr("since 0 of them are picked in two X-ray images"));
  EXPECT_EQ(asked()->button(QMessageBox::Save), nullptr);
  screenshot("unsaved-landmarks", asked());
  QTest::mouseClick(asked()->button(QMessageBox::Cancel), Qt::LeftButton);
  ASSERT_TRUE(wait("the question is answered", [&] { return asked() == nullptr; }));

  window_->controller().pick(
      {.name = "L1", .view = "AP", .uv_raw = {200, 200}, .snap = pipeline::Snap::none});
  ASSERT_TRUE(wait_idle());
  EXPECT_FALSE(window_->close());
  EXPECT_THAT(asked()->text().toStdString(), HasSubstr("Not in case.json: the picks."));
  QTest::mouseClick(asked()->button(QMessageBox::Save), Qt::LeftButton);
  ASSERT_TRUE(wait("the window is closed", [&] { return !window_->isVisible(); }));
  EXPECT_FALSE(fs::exists(folder_ / "case" / "unsaved_picks.json"));
  EXPECT_TRUE(fs::exists(folder_ / "case" / "unsaved_landmarks.json"));
}

TEST_F(WindowLandmarks, TheirClicksSnapToNoBall) {
  ASSERT_NO_FATAL_FAILURE(open());
  const auto* snap = find<QCheckBox>("snap");
  EXPECT_TRUE(snap->isEnabled() && snap->isChecked());
  press("proposeLandmarks");
  EXPECT_FALSE(snap->isEnabled() || snap->isChecked());
  EXPECT_THAT(snap->toolTip().toStdString(), HasSubstr("L1 is a landmark of a model"));
  window_->controller().undo();
  EXPECT_TRUE(snap->isEnabled() && snap->isChecked());
}

TEST_F(WindowLandmarks, AClickDuringARegistrationSaysWhyItIsNoPick) {
  ASSERT_NO_FATAL_FAILURE(open());
  press("proposeLandmarks");
  ASSERT_TRUE(wait("the image is shown", [&] { return !window_->xray(0).is_computing(); }));
  window_->controller().register_models();
  window_->strip().chosen(Phase::plan);
  ASSERT_TRUE(state().busy);
  QTest::mouseClick(&window_->xray(0), Qt::LeftButton, {}, window_->xray(0).rect().center());
  emit window_->controller().changed();  // a step of the registration
  EXPECT_THAT(window_->statusBar()->currentMessage().toStdString(),
              HasSubstr("No point is picked during other work"));
  EXPECT_THAT(says(), HasSubstr("During other work no landmark is changed"));
  EXPECT_TRUE(state().picks.empty());
  window_->controller().cancel();
  ASSERT_TRUE(wait_idle());
  EXPECT_THAT(says(), testing::Not(HasSubstr("During other work")));
}

/// A ball of 40 mm radius of about 60,000 triangles.
phantom::TriangleMesh ball() {
  const double radius = 40;
  const Eigen::Vector3d corner = Eigen::Vector3d::Constant(44);
  return phantom::surface_of([&](const Eigen::Vector3d& p) { return p.norm() - radius; }, {-corner, corner},
                             1.2);
}

TEST(SurfaceViews, AClickFindsThePlaceOnTheSurface) {
  const auto mesh = ball();
  SurfaceCamera camera;
  camera.turn = Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  camera.scale = 5;
  for (const double angle : {0.0, 0.7, 2.0}) {
    // Towards the viewer, 20 mm off the middle.
    const Eigen::Vector3d in_window(20 * std::cos(angle), 20 * std::sin(angle), -std::sqrt(1600.0 - 400));
    const Eigen::Vector3d place = camera.turn.transpose() * in_window;
    const auto found = surface_at(mesh, camera, camera.project(place).head<2>());
    ASSERT_TRUE(found);
    EXPECT_LT((*found - place).norm(), 0.5);
  }
  EXPECT_FALSE(surface_at(mesh, camera, {5 * 41, 0}));
  QElapsedTimer since;
  since.start();
  const SurfaceImage image = draw_surface(mesh, camera, {400, 400});
  RecordProperty("draw_ms", std::to_string(since.elapsed()));
  EXPECT_GT(qRed(image.pixels.pixel(200, 200)), qRed(image.pixels.pixel(30, 200)));  // lit from the front
  EXPECT_LT(qRed(image.pixels.pixel(2, 2)), 20);
}

}  // namespace landmarks_window_test
}  // namespace helicarm::gui
