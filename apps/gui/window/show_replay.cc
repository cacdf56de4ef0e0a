// SPDX-License-Identifier: Apache-2.0
// A recorded operation at the moment chosen in the replay.
#include <QDockWidget>

#include "gui/window/main_window.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

void MainWindow::build_replay() {
  replay_dock_ = new QDockWidget(tr("Replay"), this);
  replay_dock_->setObjectName("replayDock");
  replay_ = new ReplayPanel;
  replay_dock_->setWidget(replay_);
  addDockWidget(Qt::BottomDockWidgetArea, replay_dock_);
  replay_dock_->hide();
  connect(replay_, &ReplayPanel::moment_changed, this, &MainWindow::show_moment);
}

void MainWindow::open_session(const fs::path& session) {
  if (const auto opened = replay_->open(session); !opened) return say(opened.error());
  remember(Folder::sessions, session);
  replay_dock_->show();
  replay_dock_->raise();
}

ApplicationState MainWindow::displayed_state() const {
  ApplicationState state = controller_.state();
  if (!state.is_replayed || !replay_->timeline() || replay_->moment() < 0) return state;
  const auto then = state_at(*replay_->timeline(), std::size_t(replay_->moment()));
  if (!then || then->case_folder != state.folder || !state.measured) return state;
  state.hand_eye_rms_mm = then->hand_eye_rms_mm;
  state.outcomes = then->outcomes;
  return state;
}

void MainWindow::show_moment(int index) {
  if (!replay_->timeline() || index < 0) return;
  const auto then = state_at(*replay_->timeline(), std::size_t(index));
  if (!then) return say(then.error());
  const auto plan = plan_of(*replay_->timeline());
  if (!plan) return say(plan.error());
  if (then->case_folder)
    controller_.show_recorded({*then->case_folder, *plan, then->models, then->is_confirmed});
  else
    controller_.show_unregistered();
  show_recorded();
  show_state();
}

void MainWindow::show_recorded() {
  recorded_.reset();
  if (!replay_->timeline() || replay_->moment() < 0) return;
  const auto then = state_at(*replay_->timeline(), std::size_t(replay_->moment()));
  const bool is_shown = out_of_date_.isEmpty() && then && then->measured && then->case_folder &&
                        controller_.state().folder == *then->case_folder && controller_.state().measured;
  const auto plan = plan_of(*replay_->timeline());
  if (!is_shown || !plan || !(then->registered_at || plan->drill)) return;
  if (!recorded_tool_ || recorded_at_ != then->registered_at || recorded_of_ != shown_) {
    const auto tool = tool_of(*replay_->timeline(), *then, *shown_);
    if (!tool) return say(tool.error());
    recorded_tool_ = *tool;
    recorded_at_ = then->registered_at;
    recorded_of_ = shown_;
  }
  if (const auto overlay = overlay_of(*recorded_tool_, *replay_->timeline(), *then)) recorded_ = *overlay;
}

}  // namespace helicarm::gui
