// SPDX-License-Identifier: Apache-2.0
#include <QDoubleSpinBox>

#include "gui/controller/case_with_model_test.h"
#include "gui/window/window_test.h"
#include "helicarm/case_registration/register_case.h"

namespace helicarm::gui {
namespace {

TEST_F(Window, AModelIsRegisteredAndMovedByHand) {
  write_case_with_model(folder_ / "case");
  window_->open_paths({folder_ / "case"});
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  QTest::mouseClick(window_->strip().button(Phase::registration), Qt::LeftButton);
  click("registerModels");
  ASSERT_TRUE(wait("the model is registered", [&] { return state().registration && !state().busy; }));
  EXPECT_TRUE(window_->strip().button(Phase::registration)->isChecked());
  auto* models = find<QTableWidget>("modelTable");
  ASSERT_EQ(models->rowCount(), 1);
  EXPECT_EQ(models->item(0, 0)->text(), "bone");
  EXPECT_EQ(find<QTableWidget>("modelPointTable")->rowCount(), 2);
  ASSERT_TRUE(wait("the X-ray is shown", [&] { return !window_->xray(0).is_computing(); }));
  screenshot("register");

  const auto first = state().registration;
  const QImage registered = window_->xray(0).image_with_marks();
  EXPECT_FALSE(find("registerFromHere")->isEnabled());
  find<QDoubleSpinBox>("shiftX")->setValue(4);
  find<QDoubleSpinBox>("shiftY")->setValue(4);
  ASSERT_TRUE(wait("the outline has moved",
                   [&] { return state().nudged && state().nudged->outlines != first->models[0].outlines; }));
  EXPECT_NE(window_->xray(0).image_with_marks(), registered);
  screenshot("register-by-hand");
  EXPECT_TRUE(find("registerFromHere")->isEnabled());
}

TEST_F(Window, ACaseWithoutModelsHasNoRegisterStep) {
  EXPECT_FALSE(window_->strip().button(Phase::registration)->isVisible());
}

}  // namespace
}  // namespace helicarm::gui
