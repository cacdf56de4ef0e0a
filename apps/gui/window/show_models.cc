// SPDX-License-Identifier: Apache-2.0
// The registered models over the images and in the scene.
#include "gui/controller/stale.h"
#include "gui/window/main_window.h"
#include "gui/window/model_marks.h"

namespace helicarm::gui {

void MainWindow::show_outlines() {
  const ApplicationState& state = controller_.state();
  for (std::size_t i = 0; i < xrays_.size(); ++i) {
    const auto view = panels_->view_in(i);
    xrays_[i]->set_outlines(view && panels_->panel(i).shows_own_frame() ? outlines_of(state, *view)
                                                                        : std::vector<ModelOutline>{});
  }
}

void MainWindow::show_models() {
  const ApplicationState& state = controller_.state();
  decltype(shown_nudge_) nudge;
  if (state.nudged) nudge = {state.nudged->model, state.nudged->world_from_model.matrix()};
  QString out_of_date;  // of each model
  for (std::size_t i = 0; state.registration && i < state.registration->models.size(); ++i)
    out_of_date += stale_model(state, i) + '\n';
  if (shown_registration_ == movable_models(state) && shown_nudge_ == nudge &&
      shown_stale_models_ == out_of_date)
    return;
  shown_stale_models_ = out_of_date;
  shown_registration_ = movable_models(state);
  shown_nudge_ = nudge;
  scene_->show_models(models_of(state));
}

}  // namespace helicarm::gui
