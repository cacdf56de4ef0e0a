// SPDX-License-Identifier: Apache-2.0
// Registration of a case's models, and moving one by hand.
#include "gui/controller/controller.h"
#include "gui/controller/equipment.h"

namespace helicarm::gui {

using case_registration::CaseRegistration;

Expected<CaseRegistration> register_models(Equipment& equipment, const std::vector<pipeline::Pick>& picks,
                                           const std::optional<NudgedModel>& from,
                                           const std::function<void(const std::string& step)>& tell) {
  return guarded([&] {
    pipeline::Case the_case = *equipment.the_case;
    the_case.picks = picks;
    if (from) the_case.models.at(from->model).world_from_model = from->world_from_model;
    const case_registration::RegisterOptions& options = equipment.options;
    equipment.registered_by = options;
    const case_registration::Progress progress{
        [&](const std::string& model, std::string_view step) { tell(model + ": " + std::string(step)); },
        [&] {
          if (equipment.stopped) throw BadInput(Reason::interrupted, "cancelled");
        }};
    return value_or_throw(case_registration::register_loaded(
        the_case, case_registration::views_of_calibration(the_case, *equipment.measurement->calibration),
        options, progress, case_registration::located_points_of(*equipment.measurement)));
  });
}

namespace {

using Outlines = std::vector<std::vector<Eigen::Vector2d>>;

bool same_place(const NudgedModel& a, const NudgedModel& b) {
  return a.model == b.model && a.world_from_model.rotation == b.world_from_model.rotation &&
         a.world_from_model.translation == b.world_from_model.translation;
}

}  // namespace

void Controller::register_models() {
  if (!equipment_ || !can_register(state_)) return;
  begin(Phase::registration, "reading the models",
        [this, equipment = equipment_, picks = state_.picks, from = state_.nudged]() -> Change {
          const auto tell = [this](const std::string& step) {
            meanwhile([step](ApplicationState& state) { state.doing = step; });
          };
          const auto done = std::make_shared<const CaseRegistration>(
              value_or_throw(gui::register_models(*equipment, picks, from, tell)));
          return [this, done, picks](ApplicationState& state) {
            remember_edit(tr("registration"));
            state.registration = done;
            state.registered_picks = picks;
            state.nudged.reset();
          };
        });
}

void Controller::nudge(std::size_t model, const registration::RigidStep& step, bool continues) {
  if (state_.busy || !state_.registration || model >= state_.registration->models.size()) return;
  const bool is_there =
      state_.nudged ? state_.nudged->model == model && state_.nudged->step == step : step.isZero(0);
  if (is_there) return;
  const QString name = QString::fromStdString(state_.registration->models[model].registration.name);
  if (!continues) remember_edit(tr("move of %1").arg(name));
  const case_registration::RegisteredModel& registered = state_.registration->models[model];
  const registration::Registration& from = registered.registration;
  Outlines until_then = state_.nudged && state_.nudged->model == model ? std::move(state_.nudged->outlines)
                                                                       : registered.outlines;
  state_.nudged.reset();
  if (!step.isZero(0) && registered.model)
    state_.nudged = {model, step, registration::moved_about(from.world_from_model, from.centre, step),
                     std::move(until_then)};
  emit changed();
  if (!outlining_) outline_nudged();
}

void Controller::outline_nudged() {
  outlining_ = state_.nudged && !state_.busy;
  if (!outlining_) return;
  worker_.post([this, registration = state_.registration, of = *state_.nudged] {
    const case_registration::RegisteredModel& registered = registration->models[of.model];
    const auto outlines = guarded([&] {
      return case_registration::outlines(*registered.model, registered.views, of.world_from_model);
    });
    QMetaObject::invokeMethod(
        this,
        [this, of, outlines] {
          const bool is_newest = state_.nudged && same_place(*state_.nudged, of);
          if (outlines && state_.nudged && state_.nudged->model == of.model)
            state_.nudged->outlines = *outlines;
          outlining_ = false;
          if (!is_newest) outline_nudged();
          emit changed();
        },
        Qt::QueuedConnection);
  });
}

}  // namespace helicarm::gui
