// SPDX-License-Identifier: Apache-2.0
// The live data of the devices over the images and in the scene.
#include "gui/window/main_window.h"
#include "gui/xray/text.h"

namespace helicarm::gui {
namespace {

/// The scene is usually rendered in software and updated less often than the images.
constexpr unsigned scene_every = 4;

}  // namespace

void MainWindow::show_live() {
  const auto hidden = [](const LiveState& live) {
    std::vector<std::pair<Light, QString>> all;
    for (const StatusIndicator& indicator : live.indicators) all.emplace_back(indicator.light, indicator.why);
    return all;
  };
  const auto before = hidden(live_);
  live_ = controller_.live();
  add_moment(live_);
  if (hidden(live_) != before) show_steps();
  if (live_.stale) controller_.drop_plan(*live_.stale);
  live_bar_->show_live(live_);
  navigate_->show_live(live_);
  const operation::ToolOverlay* tool = recorded_ ? &*recorded_ : nullptr;
  if (live_.tool) tool = *live_.tool ? &**live_.tool : nullptr;
  for (std::size_t i = 0; i < xrays_.size(); ++i) {
    std::optional<guidance::ImageLine> line;
    const auto view = panels_->view_in(i);
    if (tool && shown_ && view && *view < shown_->views.size() && panels_->panel(i).shows_own_frame())
      if (const auto seen = tool->by_view.find(shown_->views[*view].name); seen != tool->by_view.end())
        line = seen->second;
    xrays_[i]->set_tool(line, tool && live_.tool ? age_text(tool->age_s) : QString());
  }
  if (++looks_ % scene_every != 0) return;
  LiveScene scene;
  scene.path = controller_.state().path.in_calibrator;
  if (tool && tool->calibrator_from_tip) {
    scene.calibrator_from_tip = tool->calibrator_from_tip;
    scene.bones_moved = tool->other_bones_moved;
    if (live_.robot.state) {
      scene.calibrator_from_base = *scene.calibrator_from_tip * live_.robot.state->base_from_tcp.inverse();
      scene.joints = live_.robot.state->joints;
    }
  }
  scene_->show_live(scene);
  look_at_the_robot(scene);
}

void MainWindow::look_at_the_robot(const LiveScene& scene) {
  const ApplicationState& state = controller_.state();
  const bool is_known = scene.calibrator_from_base && scene.joints;
  const bool registers = state.busy == Phase::navigate && !state.hand_eye_rms_mm && !state.drill && !is_known;
  if (out_of_date_.isEmpty())
    scene_->set_notice(registers ? tr("The robot is drawn as soon as it is registered") : QString());
  const RobotView wanted = !is_known ? RobotView::unknown : state.order ? RobotView::path : RobotView::whole;
  if (std::exchange(robot_view_, wanted) == wanted) return;
  if (wanted == RobotView::whole) scene_->look_at_robot();
  if (wanted == RobotView::path) scene_->look_near();
}

}  // namespace helicarm::gui
