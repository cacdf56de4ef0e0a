// SPDX-License-Identifier: Apache-2.0
// Picks in the X-ray images: what is shown of them, and clicks that make and move them.
#include <QMenu>
#include <algorithm>

#include "gui/controller/model_landmarks.h"
#include "gui/window/main_window.h"
#include "gui/xray/text.h"
#include "helicarm/geometry/epipolar.h"
#include "helicarm/pipeline/middle.h"

namespace helicarm::gui {
namespace {

/// Range about the middle of what the views show in which an end may lie along its ray.
constexpr double epipolar_reach_mm = 150;

}  // namespace

void MainWindow::show_picks() {
  const ApplicationState& state = controller_.state();
  const auto wanted = state.measured && phase_ == Phase::plan ? plan_->target() : std::nullopt;
  display_wanted(wanted);
  for (std::size_t i = 0; i < xrays_.size(); ++i) {
    const auto view = panels_->view_in(i);
    if (view && shown_ && *view < shown_->views.size()) show_picks_in(i, *view, wanted);
  }
}

void MainWindow::display_wanted(const std::optional<WantedPick>& wanted) {
  const std::string view = wanted ? wanted->view : "";
  if (std::exchange(wanted_view_, view) == view) return;  // the user may display others
  const auto& views = controller_.state().views;
  panels_->display(std::size_t(std::ranges::find(views, view) - views.begin()));
}

void MainWindow::show_picks_in(std::size_t panel, std::size_t number,
                               const std::optional<WantedPick>& wanted) {
  const ApplicationState& state = controller_.state();
  const pipeline::ViewResult& view = shown_->views[number];
  XrayView& xray = *xrays_[panel];
  const bool takes = controller_.takes_picks() && panels_->panel(panel).shows_own_frame();
  std::vector<FreshPick> picks;
  for (const pipeline::Pick& pick : state.picks)
    if (pick.view == view.name) {
      const Failure* failed = failure_of(state, pick.name, pick.view);
      picks.push_back({text(pick.name), pick.uv_raw, failed ? text(failed->message) : QString()});
    }
  xray.set_movable_picks(phase_ == Phase::plan && takes ? picks : std::vector<FreshPick>{});
  xray.set_picking(wanted.has_value() && takes);
  if (!panels_->panel(panel).shows_own_frame()) return;
  const auto is_in_result = [&](const std::string& name) {
    return std::ranges::any_of(shown_->points, [&](const pipeline::PointResult& point) {
      return point.name == name && point.seen[number];
    });
  };
  if (!next_pick(state) && out_of_date_.isEmpty())  // the result shows the others
    std::erase_if(picks, [&](const FreshPick& pick) {
      const std::string name = pick.name.toStdString();
      return pick.why_failed.isEmpty() && !stale_points_.contains(name) && is_in_result(name);
    });
  xray.set_picks(std::move(picks));
  const auto path = state.path.by_view.find(view.name);
  xray.set_path(path == state.path.by_view.end() ? std::vector<Eigen::Vector2d>{} : path->second);
  xray.set_epipolar(wanted ? epipolar_lines_of(wanted->point, view) : std::vector<EpipolarLine>{});
}

std::vector<MainWindow::EpipolarLine> MainWindow::epipolar_lines_of(const std::string& point,
                                                                    const pipeline::ViewResult& view) const {
  const ApplicationState& state = controller_.state();
  std::vector<EpipolarLine> lines;
  for (const pipeline::ViewResult& other : shown_->views) {
    const pipeline::Pick* pick = pick_of(state, point, other.name);
    if (&other == &view || pick == nullptr || !other.calibrated || !view.calibrated ||
        failure_of(state, point, other.name) != nullptr)
      continue;
    const auto uv = other.rectification->map.rectified_from_raw(pick->uv_raw);
    const double depth = other.calibrated->view.depth(pipeline::middle_of(state.calibrator, shown_->views));
    if (uv)
      lines.push_back(geometry::epipolar_line(other.calibrated->view, *uv, view.calibrated->view,
                                              depth - epipolar_reach_mm, depth + epipolar_reach_mm));
  }
  return lines;
}

void MainWindow::place_pick(std::size_t view, const QPointF& raw) {
  const auto wanted = plan_->target();
  if (!wanted || !shown_ || view >= shown_->views.size()) return;
  pipeline::Pick pick;
  pick.name = wanted->point;
  pick.view = shown_->views[view].name;
  pick.uv_raw = {raw.x(), raw.y()};
  if (plan_->snaps() && !is_landmark_of_model(controller_.state(), pick.name))
    pick.snap = pipeline::Snap::ball;
  if (controller_.state().source != Source::files) pick.moves_with = wanted->bone;
  controller_.pick(std::move(pick));
  plan_->placed(wanted->point);
}

void MainWindow::tell_why_not_picked() {
  const ApplicationState& state = controller_.state();
  if (phase_ != Phase::plan || !state.measured || !plan_->target() || controller_.takes_picks()) return;
  tell(tr("No point is picked during other work (%1): click again after it.").arg(text(state.doing)));
}

void MainWindow::move_pick(std::size_t view, const QString& name, const QPointF& raw) {
  const std::string view_name = shown_->views[view].name;
  for (pipeline::Pick pick : controller_.state().picks) {
    if (pick.name != name.toStdString() || pick.view != view_name) continue;
    pick.uv_raw = {raw.x(), raw.y()};
    if (!plan_->snaps_new_clicks()) pick.snap = pipeline::Snap::none;
    return controller_.pick(std::move(pick));
  }
}

void MainWindow::ask_of_pick(std::size_t view, const QString& name, const QPoint& at) {
  if (!shown_ || view >= shown_->views.size()) return;
  const std::string point = name.toStdString(), view_name = shown_->views[view].name;
  const pipeline::Pick* pick = pick_of(controller_.state(), point, view_name);
  if (pick == nullptr) return;
  const bool snaps = pick->snap == pipeline::Snap::ball;
  if (!snaps && is_landmark_of_model(controller_.state(), point)) return;
  auto* menu = new QMenu(this);
  menu->setObjectName("pickMenu");
  menu->setAttribute(Qt::WA_DeleteOnClose);
  menu->addAction(snaps ? tr("Take the click of %1 as it is").arg(name) : tr("Snap %1 to a ball").arg(name),
                  this, [this, point, view_name, snaps] {
                    controller_.set_snap(point, snaps ? pipeline::Snap::none : pipeline::Snap::ball,
                                         view_name);
                  });
  menu->popup(at);
}

}  // namespace helicarm::gui
