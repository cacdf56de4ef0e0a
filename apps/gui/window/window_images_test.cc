// SPDX-License-Identifier: Apache-2.0
// Every page in every state: legible, reachable, and as images (tools/page_images.sh).
#include <QAction>
#include <QDockWidget>
#include <QDoubleSpinBox>
#include <QMessageBox>
#include <QTabWidget>
#include <iostream>

#include "gui/controller/case_with_model_test.h"
#include "gui/window/bones_window.h"
#include "gui/window/legibility_test.h"
#include "gui/window/sequence_window.h"
#include "gui/window/style.h"
#include "gui/window/window_test.h"

namespace helicarm::gui {
namespace {

constexpr int large_text_px = 20;
/// Within which the window is laid out after a change of its size or text.
constexpr int layout_ms = 2000;

class WindowImages : public Window {
 protected:
  ~WindowImages() override { style::apply({}); }
  void write_tunnels(const std::vector<std::string>& views = {}) {
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    options.size = 512;
    for (const std::string& view : views) options.views.push_back(*simulation::view_angles(view));
    simulated_ = simulation::simulate_case(options).value();
    ASSERT_TRUE(simulation::write_case(folder_ / "tunnels", simulated_));
  }
  void open(const char* name) {
    window_->open_paths({folder_ / name});
    ASSERT_TRUE(wait("the case is read", [&] { return state().source == Source::files && !state().busy; }));
  }
  void open_tunnels() {
    ASSERT_NO_FATAL_FAILURE(write_tunnels());
    ASSERT_NO_FATAL_FAILURE(open("tunnels"));
  }
  void open_model() {
    write_case_with_model(folder_ / "model");
    ASSERT_NO_FATAL_FAILURE(open("model"));
  }
  void register_model() {
    click("registerModels");
    ASSERT_TRUE(wait("the model is registered", [&] { return state().registration && !state().busy; }));
  }
  /// At both sizes, in both themes, with usual and large text; without HELICARM_PICTURES a part of these.
  void in_every_appearance(const std::function<void(const QSize& size, const QString& appearance)>& look) {
    for (const QSize& size : {QSize(1280, 800), QSize(1920, 1080)})
      for (const style::Theme theme : {style::Theme::dark, style::Theme::light})
        for (const int text_px : {style::usual_text_px, large_text_px}) {
          const bool is_small = size.width() == 1280, is_dark = theme == style::Theme::dark;
          if (images_folder_.isEmpty() &&
              (is_dark != is_small || (!is_small && text_px != style::usual_text_px)))
            continue;
          style::apply({theme, text_px});
          window_->resize(size);
          look(size, QString("%1x%2-%3-%4")
                         .arg(size.width())
                         .arg(size.height())
                         .arg(is_dark ? "dark" : "light")
                         .arg(text_px));
        }
  }
  /// What cannot be read or reached as soon as it is laid out; saved if HELICARM_PICTURES names a folder.
  void expect_legible(QWidget& widget, const QString& what,
                      const std::function<QStringList()>& illegible_of) {
    QStringList wrong;
    const auto is_laid_out = [&] {
      QCoreApplication::processEvents();
      wrong = illegible_of();
      return wrong.isEmpty();
    };
    static_cast<void>(QTest::qWaitFor(is_laid_out, layout_ms));
    EXPECT_TRUE(wrong.isEmpty()) << what.toStdString() << ":\n" << wrong.join('\n').toStdString();
    if (!images_folder_.isEmpty()) widget.grab().save(images_folder_ + '/' + what + ".png");
  }
  /// Every page, or one.
  void inspect(const char* name, std::optional<Phase> only = {}) {
    ASSERT_TRUE(wait("the images are shown", [&] { return !window_->xray(0).is_computing(); }));
    in_every_appearance([&](const QSize& size, const QString& appearance) {
      for (const Phase phase : phases) {
        if (!window_->strip().button(phase)->isVisible() || phase != only.value_or(phase)) continue;
        window_->strip().chosen(phase);
        const QString what = QString("%1-%2-%3").arg(name, card(phase).name.toLower(), appearance);
        expect_legible(*window_, what, [&] { return illegible(*window_); });
        EXPECT_LE(window_->width(), size.width()) << what.toStdString();
        EXPECT_LE(window_->height(), size.height()) << what.toStdString();
      }
    });
    back_to_usual();
  }
  void inspect_dialog(const char* name, QWidget& dialog) {
    in_every_appearance([&](const QSize& size, const QString& appearance) {
      const QString what = QString("dialog-%1-%2").arg(name, appearance);
      expect_legible(dialog, what, [&] { return illegible_parts(dialog); });
      EXPECT_LE(dialog.width(), size.width()) << what.toStdString();
      EXPECT_LE(dialog.height(), size.height()) << what.toStdString();
    });
    back_to_usual();
  }
  QAction* action(const char* words) {
    for (QAction* each : window_->findChildren<QAction*>())
      if (each->text().contains(words)) return each;
    ADD_FAILURE() << "no action " << words;
    return nullptr;
  }
  void back_to_usual() {
    window_->resize(1280, 800);
    style::apply({});
  }

  const QString images_folder_ = qEnvironmentVariable("HELICARM_PICTURES");
  simulation::SimulatedCase simulated_;
};

TEST_F(WindowImages, Empty) { inspect("empty"); }

TEST_F(WindowImages, NotOpened) {
  window_->open_paths({folder_ / "a folder of a rather long name that does not exist" / "case"});
  ASSERT_TRUE(wait_idle());
  inspect("not-opened");
}

TEST_F(WindowImages, Measured) {
  ASSERT_NO_FATAL_FAILURE(open_tunnels());
  inspect("measured");
}

TEST_F(WindowImages, PickFailed) {
  ASSERT_NO_FATAL_FAILURE(open_tunnels());
  pipeline::Pick pick = *pick_of(state(), "FS", "AP");
  pick.uv_raw += Eigen::Vector2d(30, -30);
  window_->controller().pick(pick);
  ASSERT_TRUE(wait_idle());
  inspect("pick-failed");
}

TEST_F(WindowImages, PicksContradict) {
  ASSERT_NO_FATAL_FAILURE(open_tunnels());
  pipeline::Pick pick = *pick_of(state(), "FS", "AP");
  pick.name = "FE";
  window_->controller().pick(pick);
  ASSERT_TRUE(wait_idle());
  inspect("picks-contradict");
}

TEST_F(WindowImages, OutOfDate) {
  ASSERT_NO_FATAL_FAILURE(open_tunnels());
  const fs::path plate = folder_ / "tunnels" / "plate.json";
  ASSERT_TRUE(write_file(plate, *read_file(plate, 1 << 20) + "\n"));
  ASSERT_TRUE(wait("the change is noticed", [&] { return !state().changed_file.empty(); }));
  inspect("out-of-date");
}

TEST_F(WindowImages, Refused) {
  ASSERT_NO_FATAL_FAILURE(write_tunnels());
  fs::copy_file(folder_ / "tunnels" / "AP.dcm", folder_ / "tunnels" / "LAT.dcm",
                fs::copy_options::overwrite_existing);
  ASSERT_NO_FATAL_FAILURE(open("tunnels"));
  inspect("refused");
}

TEST_F(WindowImages, ThreeViewsAndALandmark) {
  ASSERT_NO_FATAL_FAILURE(write_tunnels({"AP:2,1", "LAT:88,-2", "OBL:45,3"}));
  ASSERT_NO_FATAL_FAILURE(open("tunnels"));
  window_->controller().add_landmark("medial epicondyle", pipeline::BoneLabel{"femur", pipeline::Side::left});
  inspect("three-views");
}

TEST_F(WindowImages, ModelBeforeRegistration) {
  ASSERT_NO_FATAL_FAILURE(open_model());
  inspect("model-before");
}

TEST_F(WindowImages, ModelRegistered) {
  ASSERT_NO_FATAL_FAILURE(open_model());
  ASSERT_NO_FATAL_FAILURE(register_model());
  inspect("model-registered");
}

TEST_F(WindowImages, ModelMovedByHand) {
  ASSERT_NO_FATAL_FAILURE(open_model());
  ASSERT_NO_FATAL_FAILURE(register_model());
  find<QDoubleSpinBox>("shiftX")->setValue(4);
  inspect("model-moved");
}

TEST_F(WindowImages, Exported) {
  ASSERT_NO_FATAL_FAILURE(open_tunnels());
  window_->controller().erase_picks("FS");
  ASSERT_TRUE(wait_idle());
  window_->controller().export_to(folder_ / "export of the tunnels");
  ASSERT_TRUE(wait_idle());
  inspect("exported");
}

TEST_F(WindowImages, Rehearsal) {
  open_rehearsal();
  inspect("rehearsal");
  ASSERT_NO_FATAL_FAILURE(register_in_rehearsal());
  ASSERT_TRUE(with_robot(
      "a path is planned", [&] { click("planWay"); }, [&] { return state().order.has_value(); }));
  inspect("rehearsal-planned");
}

TEST_F(WindowImages, DialogOfANewCase) {
  ASSERT_NO_FATAL_FAILURE(write_tunnels({"AP:2,1", "LAT:88,-2", "OBL:45,3"}));
  window_->open_paths({folder_ / "tunnels" / "AP.dcm", folder_ / "tunnels" / "LAT.dcm"});
  ASSERT_TRUE(wait("the dialog is offered", [&] { return window_->new_case() != nullptr; }));
  ASSERT_TRUE(
      wait("the images are looked at", [&] { return !window_->new_case()->is_checking() && !state().busy; }));
  inspect_dialog("new-case", *window_->new_case());
}

TEST_F(WindowImages, DialogOfTheSettings) {
  action("ttings")->trigger();
  auto* dialog = find<QDialog>("settings");
  auto* pages = dialog->findChild<QTabWidget*>();
  for (int page = 0; page < pages->count(); ++page) {
    pages->setCurrentIndex(page);
    if (page == 0 || !images_folder_.isEmpty())
      inspect_dialog(fmt::format("settings-{}", page + 1).c_str(), *dialog);
  }
}

TEST_F(WindowImages, QuestionsAndHelp) {
  ASSERT_NO_FATAL_FAILURE(open_tunnels());
  window_->controller().erase_picks("FS");
  ASSERT_TRUE(wait_idle());
  window_->close();
  inspect_dialog("unsaved-picks", *find<QMessageBox>("unsavedQuestion"));
  action("&Keys")->trigger();
  inspect_dialog("keys", *find<QMessageBox>("keys"));
}

TEST_F(WindowImages, Panels) {
  ASSERT_NO_FATAL_FAILURE(open_tunnels());
  for (const char* dock : {"measuresDock", "logDock", "objectsDock", "pointsDock"}) {
    find<QDockWidget>(dock)->show();
    inspect(dock, Phase::plan);
    find<QDockWidget>(dock)->hide();
  }
}

/// Folders of cases, of sequences or of images, or files of CTs, in HELICARM_CASES, with colons between.
TEST_F(WindowImages, GivenCases) {
  const QStringList folders = qEnvironmentVariable("HELICARM_CASES").split(':', Qt::SkipEmptyParts);
  if (folders.isEmpty()) GTEST_SKIP() << "HELICARM_CASES names no folders";
  for (const QString& folder : folders) {
    const std::string name = fs::path(folder.toStdString()).filename().string();
    SCOPED_TRACE(name);
    window_->open_paths({folder.toStdString()});
    ASSERT_TRUE(wait("it is read", [&] { return !state().busy; }));
    if (auto* bones = window_->findChild<BonesWindow*>("bones")) {
      ASSERT_TRUE(wait("the CT is read", [&] { return !bones->is_busy(); }));
      inspect_dialog((name + "-ct").c_str(), *bones);
      delete bones;
      continue;
    }
    if (auto* sequence = window_->findChild<SequenceWindow*>("sequence")) {
      ASSERT_TRUE(wait("the sequence is read", [&] { return !sequence->is_busy(); }));
      QTest::mouseClick(sequence->findChild<QPushButton*>("sequenceFollow"), Qt::LeftButton);
      ASSERT_TRUE(wait("the markers are followed", [&] { return !sequence->is_busy(); }));
      inspect_dialog((name + "-sequence").c_str(), *sequence);
      delete sequence;
      continue;
    }
    if (window_->new_case() != nullptr) {
      ASSERT_TRUE(wait("the images are looked at", [&] { return !window_->new_case()->is_checking(); }));
      inspect_dialog((name + "-new-case").c_str(), *window_->new_case());
      window_->new_case()->close();
    }
    if (can_register(state())) register_model();
    std::cout << name << ": " << seen() << std::endl;
    inspect(name.c_str());
  }
}

TEST_F(WindowImages, TextHasContrastInBothThemesAlsoInSelectedRows) {
  ASSERT_NO_FATAL_FAILURE(open_tunnels());
  pipeline::Pick pick = *pick_of(state(), "FS", "AP");
  pick.uv_raw += Eigen::Vector2d(30, -30);
  window_->controller().pick(pick);
  ASSERT_TRUE(wait_idle());
  for (const style::Theme theme : {style::Theme::dark, style::Theme::light}) {
    style::apply({theme, style::usual_text_px});
    for (const Phase phase : phases) {
      window_->strip().chosen(phase);
      QTest::qWait(20);
      const QStringList wrong = faint(*window_);
      EXPECT_TRUE(wrong.isEmpty()) << (theme == style::Theme::dark ? "dark" : "light") << ", page "
                                   << int(phase) << ":\n"
                                   << wrong.join('\n').toStdString();
    }
  }
}

TEST(Style, EveryColourOfTextHasContrastOnEveryGround) {
  for (const style::Theme theme : {style::Theme::dark, style::Theme::light}) {
    const style::Colours& in = style::colours_of(theme);
    for (const QColor& ink : {in.text, in.quiet, in.blue, in.green, in.amber, in.red})
      for (const QColor& ground : {in.ground, in.panel, in.raised, in.selected})
        EXPECT_GE(contrast(ink, ground), 4.5)
            << ink.name().toStdString() << " on " << ground.name().toStdString();
  }
}

TEST_F(WindowImages, TabReachesEverythingOnEveryPage) {
  ASSERT_NO_FATAL_FAILURE(open_model());
  ASSERT_NO_FATAL_FAILURE(register_model());
  for (const Phase phase : phases) {
    window_->strip().chosen(phase);
    QTest::qWait(20);
    window_->strip().button(phase)->setFocus();
    const auto reached = reached_by_tab();
    for (QWidget* widget : window_->findChildren<QWidget*>()) {
      const bool is_to_reach = widget->isVisible() && widget->isEnabled() &&
                               widget->window() == window_.get() && is_interactive(*widget) &&
                               (widget->focusPolicy() & Qt::TabFocus);
      EXPECT_TRUE(!is_to_reach || reached.contains(widget))
          << "page " << int(phase) << ": " << described(*widget).toStdString();
    }
  }
}

}  // namespace
}  // namespace helicarm::gui
