// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/replay_panel.h"

#include <QSignalSpy>
#include <QSlider>
#include <QTemporaryDir>
#include <QTest>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gui/replay/application_test.h"
#include "gui/replay/session_test.h"

namespace helicarm::gui {
namespace {

class Panel : public testing::Test {
 protected:
  void SetUp() override {
    application();
    write_session(folder_);
    panel_ = std::make_unique<ReplayPanel>();
    ASSERT_TRUE(panel_->open(folder_));
    panel_->show();
    panel_->activateWindow();
    ASSERT_TRUE(QTest::qWaitForWindowActive(panel_.get()));
  }

  QTemporaryDir root_;
  const std::filesystem::path folder_ = root_.path().toStdString();
  std::unique_ptr<ReplayPanel> panel_;
};

TEST_F(Panel, KeysStepAndPlay) {
  QSignalSpy changed(panel_.get(), &ReplayPanel::moment_changed);
  QTest::keyClick(panel_.get(), Qt::Key_L);
  QTest::keyClick(panel_.get(), Qt::Key_Period);
  EXPECT_EQ(panel_->moment(), 2);
  QTest::keyClick(panel_.get(), Qt::Key_J);
  QTest::keyClick(panel_.get(), Qt::Key_Comma);
  QTest::keyClick(panel_.get(), Qt::Key_J);
  EXPECT_EQ(panel_->moment(), 0);
  EXPECT_EQ(changed.count(), 4);
  QTest::keyClick(panel_.get(), Qt::Key_K);
  EXPECT_TRUE(panel_->is_playing());
  ASSERT_TRUE(QTest::qWaitFor([this] { return !panel_->is_playing(); }, 20000));
  EXPECT_EQ(panel_->moment(), int(session_kinds.size()) - 1);
}

TEST_F(Panel, SpaceBarIsNotHandled) {
  for (QWidget* widget : panel_->findChildren<QWidget*>()) {
    if (widget->focusPolicy() == Qt::NoFocus || !widget->isVisible()) continue;
    widget->setFocus();
    QTest::keyClick(widget, Qt::Key_Space);
  }
  EXPECT_EQ(panel_->moment(), 0);
  EXPECT_FALSE(panel_->is_playing());
}

TEST_F(Panel, SliderSelectsTheLastMomentNotLater) {
  auto* slider = panel_->findChild<QSlider*>();
  slider->setValue(slider->maximum());
  EXPECT_EQ(panel_->moment(), int(session_kinds.size()) - 1);
  slider->setValue(0);
  EXPECT_LT(panel_->moment(), int(session_kinds.size()) - 1);
}

TEST_F(Panel, VerificationReportsWhatItCannotReplay) {
  QSignalSpy verified(panel_.get(), &ReplayPanel::verified);
  panel_->verify();
  ASSERT_TRUE(verified.wait(20000));
  EXPECT_FALSE(verified.front().front().toBool());
  EXPECT_THAT(panel_->verdict().toStdString(), testing::HasSubstr("record"));
}

TEST(Verdicts, StateWhatIsEqualInAnEarlierFormAlone) {
  operation::ReplayReport report;
  report.finished = true;
  EXPECT_FALSE(verdict_of(report).contains("Note"));
  report.notes = {"record 7: the registration is as earlier versions recorded it"};
  const std::string words = verdict_of(report).toStdString();
  EXPECT_THAT(words, testing::StartsWith("Reproduced bit for bit"));
  EXPECT_THAT(words, testing::HasSubstr("\nNote: record 7: the registration is as earlier"));
}

TEST_F(Panel, HoldsTheStateOfItsMoment) {
  panel_->set_moment(0);
  EXPECT_FALSE(panel_->state()->measured);
  panel_->set_moment(int(session_kinds.size()) - 1);
  EXPECT_TRUE(panel_->state()->measured);
  EXPECT_EQ(ReplayPanel().state().error().reason, Reason::usage);
}

TEST_F(Panel, DamagedSessionKeepsTheOpenOne) {
  EXPECT_EQ(panel_->open(folder_ / "nowhere").error().reason, Reason::missing_file);
  EXPECT_EQ(panel_->timeline()->moments.size(), session_kinds.size());
}

}  // namespace
}  // namespace helicarm::gui
