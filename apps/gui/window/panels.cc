// SPDX-License-Identifier: Apache-2.0
// Panels of the scene's objects and of the points, and the handles of models.
#include <QAction>
#include <QDockWidget>
#include <QMenu>

#include "gui/controller/hand_moves.h"
#include "gui/window/main_window.h"
#include "gui/window/objects_panel.h"
#include "gui/window/points_panel.h"
#include "gui/window/register_page.h"
#include "gui/xray/mark_painter.h"

namespace helicarm::gui {

QDockWidget* MainWindow::add_panel(const QString& title, const char* name, QWidget* content) {
  auto* dock = new QDockWidget(title, this);
  dock->setObjectName(name);
  dock->setWidget(content);
  addDockWidget(Qt::BottomDockWidgetArea, dock);
  dock->hide();
  docks_.push_back(dock);
  return dock;
}

void MainWindow::build_panels() {
  add_panel(tr("Objects of the scene"), "objectsDock", new ObjectsPanel(*scene_));
  points_ = new PointsPanel;
  add_panel(tr("Points by views"), "pointsDock", points_);
  connect(points_, &PointsPanel::wanted, this, [this](const QString& point, std::size_t view) {
    moved_on_ = true;
    show_phase(Phase::plan);
    plan_->choose(point);
    panels_->display(view);
  });
}

void MainWindow::build_scene_apart(QMenu* view) {
  QDockWidget* dock = add_panel(tr("Scene"), "sceneDock", nullptr);
  QAction* apart = view->addAction(tr("Scene in a pa&nel of its own"));
  apart->setObjectName("sceneApart");
  apart->setCheckable(true);
  connect(apart, &QAction::toggled, this, [this, dock](bool on) {
    if (on) {
      dock->setWidget(scene_);
      dock->setFloating(true);
      dock->resize(right_->width(), right_->width());
    } else {
      right_->insertWidget(0, scene_);
      right_->setStretchFactor(0, 1);
    }
    dock->setVisible(on);
    scene_->show();
  });
  connect(dock->toggleViewAction(), &QAction::toggled, apart,
          &QAction::setChecked);  // also when it is closed
}

void MainWindow::build_handles() {
  for (std::size_t panel = 0; panel < xrays_.size(); ++panel)
    connect(xrays_[panel], &XrayView::handle_dragged, this,
            [this, panel](HandlePart part, const QPointF& from, const QPointF& to, bool continues) {
              drag_model(panel, part, from, to, continues);
            });
  connect(scene_, &SceneView::handle_shifted, this, [this](const Eigen::Vector3d& by_mm, bool continues) {
    if (const auto held = held_model())
      controller_.nudge(held->model, gui::shifted(held->step, by_mm), continues);
  });
  connect(scene_, &SceneView::handle_turned, this, [this](const Eigen::Vector3d& by_rad, bool continues) {
    if (const auto held = held_model())
      controller_.nudge(held->model, gui::turned(held->step, by_rad), continues);
  });
}

/// The model chosen on the page *Register* while that is shown and a model can be moved.
std::optional<MainWindow::HeldModel> MainWindow::held_model() const {
  const ApplicationState& state = controller_.state();
  const auto model = phase_ == Phase::registration ? register_->movable() : std::nullopt;
  const auto models = movable_models(state);
  if (!model || !models || *model >= models->models.size()) return {};
  const case_registration::RegisteredModel& registered = models->models[*model];
  if (!registered.model) return {};
  registration::RigidStep step = registration::RigidStep::Zero();
  if (state.nudged && state.nudged->model == *model) step = state.nudged->step;
  return HeldModel{*model, step, registered.registration.centre + step.tail<3>()};
}

void MainWindow::show_handles() {
  const auto held = held_model();
  const QColor ink = held ? ink::of_model(held->model) : QColor();
  std::optional<SceneView::Handle> in_scene;
  if (held)
    in_scene = {held->centre, {std::uint8_t(ink.red()), std::uint8_t(ink.green()), std::uint8_t(ink.blue())}};
  scene_->set_handle(in_scene);
  for (std::size_t i = 0; i < xrays_.size(); ++i) {
    const auto view = panels_->view_in(i);
    std::optional<ModelHandle> handle;
    if (held && view && panels_->panel(i).shows_own_frame()) {
      const auto& views = movable_models(controller_.state())->models[held->model].views;
      if (*view < views.size() && views[*view].depth(held->centre) > 1)
        handle = {views[*view].project(held->centre), ink};
    }
    xrays_[i]->set_handle(handle);
  }
}

void MainWindow::drag_model(std::size_t panel, HandlePart part, const QPointF& from, const QPointF& to,
                            bool continues) {
  const auto held = held_model();
  const auto number = panels_->view_in(panel);
  if (!held || !number || !shown_ || *number >= shown_->views.size()) return;
  const pipeline::ViewResult& view = shown_->views[*number];
  const auto& views = movable_models(controller_.state())->models[held->model].views;
  if (!view.rectification || *number >= views.size()) return;
  const auto rectified = [&](const QPointF& raw) {
    return view.rectification->map.rectified_from_raw({raw.x(), raw.y()});
  };
  const auto a = rectified(from), b = rectified(to);
  if (!a || !b) return;
  const geometry::View& camera = views[*number];
  controller_.nudge(held->model,
                    part == HandlePart::middle
                        ? gui::shifted(held->step, shift_in_view(camera, held->centre, *a, *b))
                        : gui::turned(held->step, turn_in_view(camera, held->centre, *a, *b)),
                    continues);
}

}  // namespace helicarm::gui
