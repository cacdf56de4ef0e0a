// SPDX-License-Identifier: Apache-2.0
#include <QClipboard>
#include <QFileDialog>
#include <QMenu>
#include <QScrollArea>
#include <QTableWidget>

#include "gui/window/style.h"
#include "gui/window/window_test.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::gui {
namespace {

class WindowDisplay : public Window {
 protected:
  ~WindowDisplay() override { style::apply({}); }
  void open_tunnels() {
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    ASSERT_TRUE(simulation::write_case(folder_ / "tunnels", simulation::simulate_case(options).value()));
    drop(*window_, {folder_ / "tunnels"});
    ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  }
  void press(const QKeySequence& keys) {
    const QKeyCombination key = keys[0];
    QTest::keyClick(window_.get(), key.key(), key.keyboardModifiers());
  }
};

TEST_F(WindowDisplay, EveryQuantityHasADefinition) {
  open_tunnels();
  const auto tables = window_->findChildren<QTableWidget*>();
  EXPECT_GE(tables.size(), 6);
  for (const QTableWidget* table : tables)
    for (int column = 0; column < table->columnCount(); ++column) {
      const auto* header = table->horizontalHeaderItem(column);
      ASSERT_NE(header, nullptr) << table->objectName().toStdString();
      EXPECT_GE(header->toolTip().size(), 15)
          << table->objectName().toStdString() << ": " << header->text().toStdString();
      for (const char* unit : {"mm", "px"})
        EXPECT_TRUE(!header->text().contains(unit) || header->toolTip().contains(unit))
            << header->text().toStdString();
    }
  for (const Phase phase : phases) {
    const QString tip = window_->strip().button(phase)->toolTip();
    EXPECT_TRUE(tip.contains(definition_of(phase))) << tip.toStdString();
    EXPECT_GE(definition_of(phase).size(), 15);
  }
  EXPECT_TRUE(window_->live_bar().definitions().contains("mm"));
}

TEST_F(WindowDisplay, NothingIsCutOffAt1280x800) {
  open_tunnels();
  window_->resize(1280, 800);
  for (const Phase phase : phases) {
    window_->strip().chosen(phase);
    QTest::qWait(50);
    EXPECT_LE(window_->width(), 1280);
    EXPECT_LE(window_->height(), 800);
    for (const QPushButton* button : window_->findChildren<QPushButton*>()) {
      if (!button->isVisible()) continue;
      EXPECT_GE(button->width(), button->minimumSizeHint().width()) << button->text().toStdString();
    }
    screenshot(QString("display-%1").arg(int(phase)).toLatin1());
  }
}

TEST_F(WindowDisplay, LightThemeAndLargerTextApplyAtOnce) {
  open_tunnels();
  const int height = window_->strip().height();
  const auto brightness = [&] { return qGray(window_->grab().toImage().pixel(3, window_->height() / 2)); };
  const int dark = brightness();
  style::apply({style::Theme::light, 20});
  QTest::qWait(50);
  EXPECT_GT(window_->strip().height(), height);
  EXPECT_GT(brightness(), dark + 100);
  EXPECT_LE(window_->minimumSizeHint().width(), 1280);  // STOP stays on the screen
  screenshot("display-light");
  press(QKeySequence("Ctrl+-"));
  EXPECT_EQ(style::applied().text_px, 18);
  for (int i = 0; i < 20; ++i) press(QKeySequence("Ctrl+-"));
  EXPECT_EQ(style::applied().text_px, style::smallest_text_px);
}

TEST_F(WindowDisplay, FocusReturnsAfterTheWorkOfAButton) {
  open_rehearsal();
  auto* acquire = find("shootAP");
  ASSERT_TRUE(QTest::qWaitFor([&] { return acquire->isVisible() && acquire->isEnabled(); }, enabled_ms));
  acquire->setFocus();
  ASSERT_TRUE(attempt(
      "AP is acquired", [&] { QTest::keyClick(acquire, Qt::Key_Return); },
      [&] { return state().result->views[0].xray_image != nullptr; }));
  ASSERT_TRUE(wait_idle());
  EXPECT_EQ(QApplication::focusWidget(), acquire);
}

TEST_F(WindowDisplay, CopiesTheTableOrImageThatHasTheFocus) {
  open_tunnels();
  window_->strip().chosen(Phase::plan);
  auto* table = find<QTableWidget>("endTable");
  table->setFocus();
  press(QKeySequence::Copy);
  EXPECT_THAT(QApplication::clipboard()->text().toStdString(),
              HasSubstr("FS\tstart\tAP (ball), LAT (ball)\t"));
  window_->xray(0).setFocus();
  press(QKeySequence::Copy);
  EXPECT_EQ(QApplication::clipboard()->image().size(), window_->xray(0).size());
}

TEST_F(WindowDisplay, ACasesFileDroppedOpensItsFolder) {
  open_tunnels();
  window_->controller().open_images({folder_ / "tunnels" / "AP.dcm"});
  ASSERT_TRUE(wait("the image is shown", [&] { return state().source == Source::images && !state().busy; }));
  drop(*window_, {folder_ / "tunnels" / "case.json"});
  ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  EXPECT_EQ(state().folder, folder_ / "tunnels");
}

TEST_F(WindowDisplay, TheLogHoldsTheFiguresOfEachStepAndIsCopied) {
  open_tunnels();
  find("copyLog")->click();
  const std::string log = QApplication::clipboard()->text().toStdString();
  for (const char* line : {"Acquire: 2 of 2 X-ray images", "Calibrate: FRE ", "Plan: within "})
    EXPECT_THAT(log, HasSubstr(line));
}

TEST_F(WindowDisplay, PartsOfTheSceneAreHidden) {
  open_tunnels();
  auto* scene = find<SceneView>("scene");
  const QImage all = scene->grab().toImage();
  const auto* menu = window_->findChild<QMenu*>("sceneParts");
  ASSERT_NE(menu, nullptr);
  for (QAction* action : menu->actions())
    if (action->isCheckable()) action->trigger();
  EXPECT_FALSE(scene->parts());
  EXPECT_NE(scene->grab().toImage(), all);
}

TEST_F(WindowDisplay, ExportMakesItsFolder) {
  open_tunnels();
  press(QKeySequence("Ctrl+E"));
  auto* dialog = find<QFileDialog>("exportDialog");
  const fs::path folder = folder_ / "new" / "export";
  fs::create_directories(folder.parent_path());
  dialog->setDirectory(QString::fromStdString(folder.parent_path().string()));
  dialog->selectFile("export");
  QTest::keyClick(dialog, Qt::Key_Return);
  EXPECT_TRUE(wait("the results are written", [&] { return fs::exists(folder / "result.json"); }));
  EXPECT_TRUE(wait_idle());
}

}  // namespace
}  // namespace helicarm::gui
