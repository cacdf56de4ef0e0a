// SPDX-License-Identifier: Apache-2.0
// Opening something else, and closing, ask before they lose work.
#include <QAction>
#include <QMenu>
#include <QMessageBox>

#include "gui/window/window_test.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::gui {
namespace {

class WindowWithACase : public Window {
 protected:
  void SetUp() override {
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    options.size = 512;
    ASSERT_TRUE(simulation::write_case(other(), simulation::simulate_case(options).value()));
  }
  fs::path other() const { return folder_ / "other"; }
  void acquire() {
    open_rehearsal();
    ASSERT_TRUE(attempt(
        "AP is acquired", [&] { click("shootAP"); },
        [&] { return state().result->views[0].xray_image != nullptr; }));
  }
  QMessageBox* question() { return window_->findChild<QMessageBox*>("leaveQuestion"); }
  void answer(QMessageBox::StandardButton button) {
    ASSERT_NE(question(), nullptr);
    QTest::mouseClick(question()->button(button), Qt::LeftButton);
    ASSERT_TRUE(wait("the question is answered", [&] { return question() == nullptr; }));
    ASSERT_TRUE(wait_idle());
  }
  bool operates() { return state().source == Source::virtual_or; }
};

TEST_F(WindowWithACase, ADroppedCaseEndsAnOperationOnlyAfterYes) {
  ASSERT_NO_FATAL_FAILURE(acquire());
  drop(*window_, {other()});
  ASSERT_NO_FATAL_FAILURE(answer(QMessageBox::No));
  EXPECT_TRUE(operates());
  drop(*window_, {other()});
  ASSERT_NO_FATAL_FAILURE(answer(QMessageBox::Yes));
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured; }));
  EXPECT_EQ(state().source, Source::files);
}

TEST_F(WindowWithACase, RecentOnesNewRehearsalAndQuittingAskToo) {
  window_->open_paths({other()});
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  ASSERT_NO_FATAL_FAILURE(acquire());
  const auto actions = window_->findChildren<QAction*>();
  const auto trigger = [&](const QString& words) {
    for (QAction* action : actions)
      if (action->text().remove('&').startsWith(words)) return action->trigger();
    FAIL() << words.toStdString();
  };
  for (const QString& words :
       {QString::fromStdString(other().string()), QString("New rehearsal"), QString("Quit")}) {
    trigger(words);
    ASSERT_NO_FATAL_FAILURE(answer(QMessageBox::No));
    EXPECT_TRUE(operates());
    EXPECT_TRUE(window_->isVisible());
  }
}

TEST_F(WindowWithACase, AnUntouchedRehearsalIsLeftWithoutAQuestion) {
  open_rehearsal();
  drop(*window_, {other()});
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  EXPECT_TRUE(window_->close());
  EXPECT_EQ(question(), nullptr);
}

TEST_F(WindowWithACase, ClosingTellsThatUnsavedPicksAreKeptAndOffersToSaveThem) {
  drop(*window_, {other()});
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  pipeline::Pick moved = state().picks.front();
  moved.uv_raw.x() += 1;
  window_->controller().pick(moved);
  ASSERT_TRUE(wait_idle());
  const auto asked = [&] { return window_->findChild<QMessageBox*>("unsavedQuestion"); };
  EXPECT_FALSE(window_->close());
  ASSERT_NE(asked(), nullptr);
  EXPECT_THAT(asked()->text().toStdString(), HasSubstr("unsaved_picks.json"));
  QTest::mouseClick(asked()->button(QMessageBox::Cancel), Qt::LeftButton);
  ASSERT_TRUE(wait("the question is answered", [&] { return asked() == nullptr; }));
  EXPECT_TRUE(window_->isVisible());
  EXPECT_FALSE(window_->close());
  QTest::mouseClick(asked()->button(QMessageBox::Save), Qt::LeftButton);
  ASSERT_TRUE(wait("the window is closed", [&] { return !window_->isVisible(); }));
  EXPECT_FALSE(fs::exists(other() / "unsaved_picks.json"));
}

TEST_F(WindowWithACase, PicksThatCannotBeKeptAreAskedFor) {
  ASSERT_TRUE(write_file(other() / "unsaved_picks.json", "[{"));
  drop(*window_, {other()});
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  window_->controller().erase_picks("FS");
  ASSERT_TRUE(wait_idle());
  EXPECT_FALSE(window_->close());
  ASSERT_NO_FATAL_FAILURE(answer(QMessageBox::Yes));
  EXPECT_FALSE(window_->isVisible());
}

TEST_F(WindowWithACase, ACaseOpenedDuringAMeasurementFollowsIt) {
  fs::copy(other(), folder_ / "next", fs::copy_options::recursive);
  window_->open_paths({other()});
  ASSERT_TRUE(state().busy);
  window_->open_paths({folder_ / "next"});
  ASSERT_TRUE(wait("the next case is measured",
                   [&] { return state().measured && !state().busy && state().folder == folder_ / "next"; }));
}

}  // namespace
}  // namespace helicarm::gui
