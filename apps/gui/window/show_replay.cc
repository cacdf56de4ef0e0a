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
  const auto& then = replay_->state();
  if (!state.is_replayed || !then || then->case_folder != state.folder || !state.measured) return state;
  state.hand_eye_rms_mm = then->hand_eye_rms_mm;
  state.outcomes = then->outcomes;
  state.is_guided = then->is_guided;
  return state;
}

void MainWindow::show_moment() {
  const auto& then = replay_->state();
  if (!then) return say(then.error());
  const auto plan = plan_of(*replay_->timeline());
  if (!plan) return say(plan.error());
  recorded_markers_ = recorded_indicators(plan->tracker, *then);
  if (then->case_folder)
    controller_.show_recorded({*then->case_folder, *plan, then->models, then->is_confirmed});
  else
    controller_.show_unregistered();
  show_recorded();
  show_state();
}

void MainWindow::show_recorded() {
  recorded_.reset();
  const auto& then = replay_->state();
  const ApplicationState& state = controller_.state();
  const bool is_shown = out_of_date_.isEmpty() && state.is_replayed && state.measured && then &&
                        then->measured && then->case_folder == state.folder;
  if (!is_shown || !(then->registered_at || state.drill)) return;
  if (!recorded_tool_ || recorded_at_ != then->registered_at || recorded_of_ != shown_) {
    const auto tool = tool_of(*replay_->timeline(), *then, *shown_);
    if (!tool) return say(tool.error());
    recorded_tool_ = *tool;
    recorded_at_ = then->registered_at;
    recorded_of_ = shown_;
  }
  if (const auto overlay = overlay_of(*recorded_tool_, *replay_->timeline(), *then)) recorded_ = *overlay;
}

/// In place of devices.
void MainWindow::add_moment(LiveState& live) const {
  const auto& then = replay_->state();
  if (!controller_.state().is_replayed || !then) return;
  live.indicators = recorded_markers_;
  live.tunnel = QString::fromStdString(then->tunnel);
  live.drill = then->guidance;
}

}  // namespace helicarm::gui
