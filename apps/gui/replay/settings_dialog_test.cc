// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/settings_dialog.h"

#include <QCheckBox>
#include <QDialogButtonBox>
#include <QDoubleSpinBox>
#include <QPushButton>
#include <QTemporaryDir>
#include <QTest>
#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gui/replay/application_test.h"
#include "gui/replay/field_box.h"
#include "gui/replay/kept_settings.h"
#include "helicarm/case_registration/register_fields.h"
#include "helicarm/operation/plan_fields.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/virtual_devices/virtual_devices_fields.h"

namespace helicarm::gui {
namespace {

class Dialog : public testing::Test {
 protected:
  void SetUp() override { application(); }
  static FieldBox& box(SettingsDialog& dialog, const char* name) {
    return *dialog.findChildren<FieldBox*>(name).front();
  }
};

TEST_F(Dialog, ReturnsUneditedValuesUnchanged) {
  Settings given;
  given.run.method = rectification::Method::paper;
  given.run.max_error_mm = 0.123456789;  // more digits than the box shows
  given.plan.robot.approach.gap_mm = -3;
  given.plan.views = {"one", "two"};
  const Settings back = SettingsDialog(given).settings();
  EXPECT_EQ(back.run.method, rectification::Method::paper);
  EXPECT_EQ(back.run.max_error_mm, 0.123456789);
  EXPECT_EQ(operation::to_json(back.plan), operation::to_json(given.plan));
  EXPECT_EQ(back.virtual_or.tracker_rate_hz, given.virtual_or.tracker_rate_hz);
}

TEST_F(Dialog, HasABoxForEveryField) {
  SettingsDialog dialog({});
  for (const auto& field : pipeline::run_fields)
    EXPECT_FALSE(box(dialog, field.name.data()).toolTip().isEmpty());
  for (const auto& field : case_registration::search_fields)
    EXPECT_FALSE(box(dialog, field.name.data()).toolTip().isEmpty());
  for (const auto& field : operation::plan_fields)
    EXPECT_FALSE(dialog.findChildren<FieldBox*>(field.name.data()).isEmpty()) << field.name;
}

TEST_F(Dialog, KeysChangeANumber) {
  SettingsDialog dialog({});
  auto* rate = box(dialog, "tracker_rate_hz").findChild<QDoubleSpinBox*>();
  rate->selectAll();
  QTest::keyClicks(rate, "75.5");
  EXPECT_EQ(dialog.settings().virtual_or.tracker_rate_hz, 75.5);
  EXPECT_TRUE(rate->text().endsWith(" Hz"));
  QTest::keyClicks(rate, "99999");
  EXPECT_TRUE(check_fields<virtual_devices::VirtualDevicesOptions>(virtual_devices::virtual_devices_fields,
                                                                   dialog.settings().virtual_or, ""));
}

TEST_F(Dialog, NumberSnapsToItsSteps) {
  SettingsDialog dialog({});
  auto* size = box(dialog, "picture_size_px").findChild<QDoubleSpinBox*>();
  size->setValue(700);
  EXPECT_EQ(dialog.settings().virtual_or.image_size, 512);
  size->setValue(1000);
  EXPECT_EQ(dialog.settings().virtual_or.image_size, 1024);
}

TEST_F(Dialog, LimitMayBeLeftUnset) {
  SettingsDialog dialog({});
  const auto limits =
      dialog.findChildren<FieldBox*>("max_error_mm");  // required in the plan, optional in the run
  const auto found =
      std::ranges::find_if(limits, [](FieldBox* each) { return each->findChild<QCheckBox*>() != nullptr; });
  ASSERT_NE(found, limits.end());
  FieldBox& limit = **found;
  EXPECT_FALSE(dialog.settings().run.max_error_mm);
  limit.findChild<QCheckBox*>()->setChecked(true);
  limit.findChild<QDoubleSpinBox*>()->setValue(1.5);
  EXPECT_EQ(dialog.settings().run.max_error_mm, 1.5);
}

TEST_F(Dialog, RestoresDefaults) {
  Settings given;
  given.run.max_error_mm = 3;
  given.virtual_or.seed = 77;
  SettingsDialog dialog(given);
  dialog.findChild<QDialogButtonBox*>()->button(QDialogButtonBox::RestoreDefaults)->click();
  EXPECT_FALSE(dialog.settings().run.max_error_mm);
  EXPECT_EQ(dialog.settings().virtual_or.seed, 1u);
}

TEST(KeptSettings, ComeBackWithoutThoseOutsideTheLimits) {
  const QTemporaryDir folder;
  QSettings store(folder.filePath("kept.ini"), QSettings::IniFormat);
  Settings given;
  given.run.max_error_mm = 1.25;
  given.run.method = rectification::Method::paper;
  given.virtual_or.seed = 77;
  given.plan.max_error_mm = 0.1;
  keep_settings(store, given);
  const Settings kept = kept_settings(store);
  EXPECT_EQ(kept.run.max_error_mm, 1.25);
  EXPECT_EQ(kept.run.method, rectification::Method::paper);
  EXPECT_EQ(kept.virtual_or.seed, 77u);
  EXPECT_EQ(kept.plan.max_error_mm, 0.1);
  store.setValue("settings/run/max_error_mm", "-5");
  store.setValue("settings/virtual_devices/seed", "many");
  EXPECT_FALSE(kept_settings(store).run.max_error_mm);
  EXPECT_EQ(kept_settings(store).virtual_or.seed, 1u);
  keep_settings(store, {});
  EXPECT_TRUE(store.allKeys().isEmpty());
}

}  // namespace
}  // namespace helicarm::gui
