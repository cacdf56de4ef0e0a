// SPDX-License-Identifier: Apache-2.0
// A case whose views bring cameras of another program.
#include <QCheckBox>

#include "gui/controller/case_with_cameras_test.h"
#include "gui/window/legibility_test.h"
#include "gui/window/register_page.h"
#include "gui/window/window_test.h"

namespace helicarm::gui {
namespace cameras_window_test {

class WindowCameras : public Window {
 protected:
  bool open() {
    write_case_with_cameras(folder_ / "case");
    window_->open_paths({folder_ / "case"});
    return wait("the case is open", [&] { return state().measured && !state().busy; });
  }
  void show(Phase phase) { QTest::mouseClick(window_->strip().button(phase), Qt::LeftButton); }
  std::string lead() {
    for (const QLabel* label : window_->findChildren<QLabel*>("lead"))
      if (label->isVisible()) return label->text().toStdString();
    return {};
  }
};

TEST_F(WindowCameras, ThePagesSayThatTheCamerasAreGiven) {
  ASSERT_TRUE(open());
  EXPECT_TRUE(window_->strip().button(Phase::registration)->isChecked());
  show(Phase::calibrate);
  EXPECT_THAT(lead(), HasSubstr("files of another program: AP by AP.json, LAT by LAT.json"));
  EXPECT_FALSE(find<QTableWidget>("viewTable")->isVisible());
  EXPECT_FALSE(find<QTableWidget>("ballTable")->isVisible());
  ASSERT_TRUE(wait("the X-ray is shown", [&] { return !window_->xray(0).is_computing(); }));
  screenshot("cameras-calibrate");
  EXPECT_EQ(illegible_parts(*window_).join('\n').toStdString(), "");
  show(Phase::plan);
  EXPECT_FALSE(find<QCheckBox>("treMap")->isEnabled());
  EXPECT_EQ(find<QCheckBox>("treMap")->toolTip(), "The errors of the given cameras are not known");
}

TEST_F(WindowCameras, TheModelIsRegisteredAndItsOutlineShown) {
  ASSERT_TRUE(open());
  click("registerModels");
  ASSERT_TRUE(wait("the model is registered", [&] { return state().registration && !state().busy; }));
  const auto* models = find<QTableWidget>("modelTable");
  EXPECT_EQ(models->item(0, 1)->text(), "warn");
  EXPECT_THAT(find<QLabel>("registerSays")->text().toStdString(), HasSubstr("covariance_missing"));
  EXPECT_TRUE(find<QLabel>("tunnelSlices")->isVisible());
  ASSERT_TRUE(wait("the X-ray is shown", [&] { return !window_->xray(0).is_computing(); }));
  screenshot("cameras-register");
  show(Phase::plan);
  EXPECT_EQ(find<QTableWidget>("tunnelTable")->rowCount(), 1);
  screenshot("cameras-plan");
}

TEST_F(WindowCameras, ALocatedPointHasNoError) {
  ASSERT_TRUE(open());
  window_->controller().add_landmark("L1");
  for (std::size_t i = 0; i < 2; ++i) {
    window_->controller().pick({.name = "L1", .view = state().views[i], .uv_raw = {250, 260}});
    ASSERT_TRUE(wait("it is picked", [&] { return !state().busy; }));
  }
  show(Phase::plan);
  ASSERT_TRUE(state().result->points.at(0).place);
  const auto* points = find<QTableWidget>("endTable");
  const auto row_of_error = [&](const QString& title) {
    for (int column = 0; column < points->columnCount(); ++column)
      if (points->horizontalHeaderItem(column)->text() == title) return points->item(0, column)->text();
    return QString("no such column");
  };
  EXPECT_EQ(row_of_error("±95 %, mm"), "–");
  EXPECT_EQ(row_of_error("σ x, mm"), "–");
  EXPECT_THAT(row_of_error("Remark").toStdString(), HasSubstr("covariance_missing"));
  screenshot("cameras-points");
}

TEST_F(WindowCameras, APickInOneViewIsShownBesideTheModels) {
  ASSERT_TRUE(open());
  click("placeModels");
  ASSERT_TRUE(wait("the models are displayed", [&] { return state().at_starts && !state().busy; }));
  show(Phase::plan);
  window_->controller().add_landmark("L1");
  ASSERT_TRUE(wait("the X-ray is shown", [&] { return !state().busy && !window_->xray(0).is_computing(); }));
  const QImage without = window_->xray(0).image_with_marks();
  window_->controller().pick({.name = "L1", .view = state().views[0], .uv_raw = {250, 260}});
  ASSERT_TRUE(wait("it is picked", [&] { return !state().busy && !window_->xray(0).is_computing(); }));
  EXPECT_NE(window_->xray(0).image_with_marks(), without);
}

TEST_F(WindowCameras, ACameraThatCannotBeReadIsNamed) {
  write_case_with_cameras(folder_ / "case");
  ASSERT_TRUE(write_file(folder_ / "case" / "LAT.json", "{\"K\": 7}"));
  window_->open_paths({folder_ / "case"});
  ASSERT_TRUE(wait("it is refused", [&] { return !state().busy && !state().refusals.empty(); }));
  EXPECT_THAT(find<QLabel>("notOpened")->text().toStdString(), HasSubstr("LAT.json"));
}

}  // namespace cameras_window_test
}  // namespace helicarm::gui
