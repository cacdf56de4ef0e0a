// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QCoreApplication>
#include <QElapsedTimer>
#include <QGuiApplication>
#include <QThread>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "gui/controller/case_with_model_test.h"
#include "gui/controller/controller.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::gui {

/// A controller and the application whose events it needs. `Application`: QGuiApplication where images are
/// drawn, else QCoreApplication.
template <class Application>
class ControllerFixture : public testing::Test {
 protected:
  ControllerFixture() : app_(argc_, argv_), controller_(std::make_unique<Controller>()) {}

  const ApplicationState& state() const { return controller_->state(); }
  /// Until `done`; meanwhile reads all live data, as the window does.
  template <class Done>
  bool wait(const char* what, const Done& done) {
    QElapsedTimer since;
    since.start();
    while (!done() && since.elapsed() < patience_ms) {
      QCoreApplication::processEvents();
      static_cast<void>(controller_->live());
      QThread::msleep(5);
    }
    if (done()) return true;
    ADD_FAILURE() << "timeout waiting until " << what << "; observed: " << observed();
    return false;
  }
  bool idle() {
    return wait("the controller is idle", [&] { return !state().busy; });
  }
  bool register_models() {
    controller_->register_models();
    if (!idle()) return false;
    if (!state().registration) ADD_FAILURE() << "no registration; observed: " << observed();
    return bool(state().registration);
  }

  std::string observed() const {
    std::string words = state().busy ? "busy with " + state().doing : "idle";
    for (const auto& [phase, failure] : state().refusals) words += "; " + failure.message;
    return words;
  }

  static constexpr int patience_ms = 600000;  // for a sanitized program on a busy machine
  int argc_ = 1;
  char name_[5] = "ctrl";
  char* argv_[2] = {name_, nullptr};
  Application app_;
  TemporaryFolder folder_;
  std::unique_ptr<Controller> controller_;  // ends before its folder and the application
};

/// Of `write_case_with_model`, once for all its tests.
class ControllerWithModel : public ControllerFixture<QGuiApplication> {
 protected:
  static void SetUpTestSuite() {
    written_ = std::make_unique<TemporaryFolder>();
    truth_ = write_case_with_model(written_->path());
  }
  static void TearDownTestSuite() { written_.reset(); }

  static inline std::unique_ptr<TemporaryFolder> written_;
  static inline geometry::RigidTransform truth_;
};

}  // namespace helicarm::gui
