// SPDX-License-Identifier: Apache-2.0
#include "gui/window/model_marks.h"

#include "gui/controller/stale.h"
#include "gui/xray/mark_painter.h"
#include "gui/xray/text.h"
#include "helicarm/case_registration/register_case.h"

namespace helicarm::gui {

using case_registration::RegisteredModel;

std::vector<ModelShape> models_of(const ApplicationState& state) {
  std::vector<ModelShape> shapes;
  const auto models = movable_models(state);
  for (std::size_t i = 0; models && i < models->models.size(); ++i) {
    std::optional<geometry::RigidTransform> by_hand;
    if (!state.registration) {
      if (!models->models[i].model) continue;  // of landmarks alone: it has no start
      by_hand = models->models[i].registration.world_from_model;
    }
    if (state.nudged && state.nudged->model == i) by_hand = state.nudged->world_from_model;
    const QColor& ink = ink::of_model(i);
    if (auto shape =
            shape_of(models->models[i], by_hand,
                     {std::uint8_t(ink.red()), std::uint8_t(ink.green()), std::uint8_t(ink.blue())})) {
      if (shape->state == ModelShape::State::registered && !stale_model(state, i).isEmpty()) {
        shape->state = ModelShape::State::out_of_date;
        shape->points.clear();
        shape->tunnels.clear();
      }
      if (!state.registration && !is_moved(state, i) && !is_placed(state, i))
        shape->state = ModelShape::State::not_registered;
      shapes.push_back(*std::move(shape));
    }
  }
  return shapes;
}

namespace {

/// Of a tunnel whose wall leaves the bone, or comes nearer to its surface than planned.
std::optional<QColor> warning_ink(const RegisteredModel& model, std::size_t tunnel) {
  if (tunnel >= model.bone_checks.size() || !model.bone_checks[tunnel]) return {};
  const registration::BoneCheck& check = *model.bone_checks[tunnel];
  if (check.is_breach()) return ink::breach;
  if (check.is_thin()) return ink::thin;
  return {};
}

}  // namespace

std::vector<ModelOutline> outlines_of(const ApplicationState& state, std::size_t view) {
  std::vector<ModelOutline> outlines;
  const auto models = movable_models(state);
  for (std::size_t i = 0; models && i < models->models.size(); ++i) {
    const RegisteredModel& model = models->models[i];
    const bool is_nudged = state.nudged && state.nudged->model == i;
    const auto& dots = is_nudged ? state.nudged->outlines : model.outlines;
    ModelOutline& outline = outlines.emplace_back();
    if (view < dots.size()) outline.dots = dots[view];
    if (!state.registration || !stale_model(state, i).isEmpty() || model.registration.failure ||
        view >= model.views.size())
      continue;
    const geometry::View& camera = model.views[view];
    for (std::size_t k = 0; k < model.tunnel_ends.size(); ++k) {
      const auto& [start, end] = model.tunnel_ends[k];
      const Eigen::Vector3d &from = model.points[start].place.in_calibrator,
                            &to = model.points[end].place.in_calibrator;
      if (camera.depth(from) > 1 && camera.depth(to) > 1)
        outline.tunnels.push_back({{camera.project(from), camera.project(to)}, warning_ink(model, k)});
    }
    for (const case_registration::RegisteredPoint& point : model.points)
      if (const Eigen::Vector3d& at = point.place.in_calibrator; model.views[view].depth(at) > 1)
        outline.points.emplace_back(text(point.name), model.views[view].project(at));
  }
  return outlines;
}

}  // namespace helicarm::gui
