// SPDX-License-Identifier: Apache-2.0
// A run of images of a calibrator: its film, its list of images, its curves.
#include <QTabWidget>
#include <QTableWidget>

#include "gui/window/curves_view.h"
#include "gui/window/legibility_test.h"
#include "gui/window/run_window.h"
#include "gui/window/window_test.h"
#include "gui/xray/xray_view.h"
#include "helicarm/sweep/drawn_run_test.h"

namespace helicarm::gui {
namespace {

constexpr int blank_image = 4, images_of_run = 16;

class WindowRun : public Window {
 protected:
  void open() {
    sweep::DrawnRun drawn;
    drawn.frames = images_of_run;
    drawn.blank = {blank_image};
    fs::create_directories(folder_ / "run");
    drawn.write(folder_ / "run");
    drop(*window_, {folder_ / "run"});
    ASSERT_TRUE(wait("the run is shown", [&] { return run() != nullptr; }));
    wait_free();
  }
  RunWindow* run() { return window_->findChild<RunWindow*>("run"); }
  template <typename Part>
  Part* part(const char* name) {
    return run()->findChild<Part*>(name);
  }
  std::string says() { return part<QLabel>("runSays")->text().toStdString(); }
  void click(const char* name) { QTest::mouseClick(part<QPushButton>(name), Qt::LeftButton); }
  void wait_free() {
    ASSERT_TRUE(wait("the run is free", [&] { return !run()->is_busy(); }));
  }
};

TEST_F(WindowRun, IsCalibratedListedPlayedAndDrawn) {
  ASSERT_NO_FATAL_FAILURE(open());
  auto* images = part<QTableWidget>("runImages");
  EXPECT_EQ(images->rowCount(), images_of_run);
  EXPECT_EQ(images->item(0, 1)->text(), "");  // not calibrated yet
  EXPECT_FALSE(part<QPushButton>("runWrite")->isEnabled());
  click("runCalibrate");
  ASSERT_NO_FATAL_FAILURE(wait_free());
  ASSERT_TRUE(run()->shown()->sweep) << says();
  EXPECT_EQ(images->item(0, 1)->text(), "accepted") << says();
  EXPECT_EQ(images->item(blank_image - 1, 1)->text(), "refused");
  EXPECT_EQ(images->item(blank_image - 1, 5)->text(), "blank_image");
  EXPECT_THAT(says(), HasSubstr("15 of 16 images accepted"));
  emit images->cellClicked(9, 0);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  EXPECT_EQ(run()->frame(), 9);
  screenshot("run", run());
  EXPECT_EQ(illegible_parts(*run()).join('\n').toStdString(), "");
  auto* curves = part<CurvesView>("runCurves");
  EXPECT_TRUE(curves->svg().contains("Source from the reference orbit"));
  part<QComboBox>("runSheet")->setCurrentIndex(1);
  EXPECT_TRUE(curves->svg().contains("refused"));
  part<QComboBox>("runSheet")->setCurrentIndex(0);
  part<QTabWidget>("runTabs")->setCurrentIndex(1);
  screenshot("run-curves", run());
  EXPECT_EQ(illegible_parts(*run()).join('\n').toStdString(), "");
  click("runPlay");
  ASSERT_TRUE(wait("it plays to its end", [&] { return run()->frame() == images_of_run - 1; }));
}

TEST_F(WindowRun, SavedFilmHasEachImageWithItsOwnLabels) {
  ASSERT_NO_FATAL_FAILURE(open());
  click("runCalibrate");
  ASSERT_NO_FATAL_FAILURE(wait_free());
  run()->set_frame(5);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  auto* view = run()->findChild<XrayView*>();
  QImage displayed(view->size(), QImage::Format_RGB32);
  view->render(&displayed);
  run()->save_film(folder_);
  ASSERT_TRUE(wait("it is saved", [&] { return says().find("film's images") != std::string::npos; }));
  const QImage saved((folder_ / "image-00006.png").c_str());
  EXPECT_EQ(saved.convertToFormat(QImage::Format_RGB32), displayed);
}

TEST_F(WindowRun, ACancelledCalibrationLeavesTheRunAsItWas) {
  ASSERT_NO_FATAL_FAILURE(open());
  click("runCalibrate");
  click("runCancel");
  ASSERT_NO_FATAL_FAILURE(wait_free());
  EXPECT_FALSE(run()->shown()->sweep);
  EXPECT_THAT(says(), HasSubstr("cancelled"));
  EXPECT_TRUE(part<QPushButton>("runCalibrate")->isEnabled());
}

TEST_F(WindowRun, NothingOfARunStaysUnderTheNameOfOneThatCannotBeRead) {
  ASSERT_NO_FATAL_FAILURE(open());
  click("runCalibrate");
  ASSERT_NO_FATAL_FAILURE(wait_free());
  ASSERT_TRUE(run()->shown()->sweep) << says();
  fs::copy(folder_ / "run", folder_ / "other", fs::copy_options::recursive);
  Json given = *read_json(folder_ / "other" / "case.json");
  given["calibrator"] = "missing.json";
  ASSERT_TRUE(write_file(folder_ / "other" / "case.json", to_text(given)));
  drop(*window_, {folder_ / "other"});
  ASSERT_NO_FATAL_FAILURE(wait_free());
  EXPECT_FALSE(run()->shown());
  EXPECT_THAT(says(), HasSubstr("missing.json"));
  EXPECT_EQ(part<QTableWidget>("runImages")->rowCount(), 0);
  EXPECT_FALSE(part<QPushButton>("runWrite")->isEnabled());
}

TEST_F(WindowRun, AnImageThatIsNoImageIsNamed) {
  ASSERT_NO_FATAL_FAILURE(open());
  ASSERT_TRUE(write_file(folder_ / "run" / "run_002.png", "no image"));
  click("runCalibrate");
  ASSERT_NO_FATAL_FAILURE(wait_free());
  EXPECT_FALSE(run()->shown()->sweep);
  EXPECT_THAT(says(), HasSubstr("run_002.png"));
}

}  // namespace
}  // namespace helicarm::gui
