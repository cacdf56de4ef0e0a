// SPDX-License-Identifier: Apache-2.0
// Registration of a case's models, and moving one by hand.
#include "gui/controller/controller.h"
#include "gui/controller/equipment.h"
#include "gui/controller/model_landmarks.h"

namespace helicarm::gui {

using case_registration::CaseRegistration;

Expected<CaseRegistration> register_models(Equipment& equipment, const std::vector<pipeline::Pick>& picks,
                                           const ModelLandmarks& landmarks,
                                           const std::vector<operation::ModelStart>& starts,
                                           const std::function<void(const std::string& step)>& tell) {
  return guarded([&] {
    pipeline::Case the_case = *equipment.the_case;
    the_case.picks = picks;
    start_from_landmarks(the_case, landmarks, starts);
    for (const operation::ModelStart& start : starts)
      std::ranges::find(the_case.models, start.model, &pipeline::CaseModel::name)->world_from_model =
          start.world_from_model;
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
  if (equipment_->operation) return register_in_operation();
  begin(Phase::registration, "reading the models",
        [this, equipment = equipment_, picks = state_.picks, landmarks = state_.model_landmarks,
         starts = starts_by_hand()]() -> Change {
          const auto tell = [this](const std::string& step) {
            meanwhile([step](ApplicationState& state) { state.doing = step; });
          };
          const auto done = std::make_shared<const CaseRegistration>(
              value_or_throw(gui::register_models(*equipment, picks, landmarks, starts, tell)));
          return [this, done, picks, landmarks, starts](ApplicationState& state) {
            remember_edit(tr("registration"));
            state.registration = done;
            state.registered_picks = picks;
            state.registered_landmarks = landmarks;
            state.starts_by_hand = starts;
            state.nudged.reset();
          };
        });
}

/// With the model that is moved now those that were registered from a pose by hand before; none where no
/// model is moved.
std::vector<operation::ModelStart> Controller::starts_by_hand() const {
  if (!state_.nudged) return {};
  std::vector<operation::ModelStart> starts = state_.starts_by_hand;
  const std::string& name = state_.models.at(state_.nudged->model);
  std::erase_if(starts, [&](const operation::ModelStart& start) { return start.model == name; });
  starts.push_back({name, state_.nudged->world_from_model});
  return starts;
}

void Controller::register_in_operation() {
  if (state_.busy) return;
  state_.order.reset();  // those to the models' tunnels end with the registration
  state_.path = {};
  begin(Phase::registration, "reading the models",
        [this, equipment = equipment_, starts = starts_by_hand()]() -> Change {
          const int before = equipment->operation->registrations();
          const auto done = equipment->operation->register_models(starts, [equipment] {
            if (equipment->stopped) throw BadInput(Reason::interrupted, "cancelled");
          });
          if (equipment->operation->registrations() == before) throw BadInput(done.error());
          const auto registered =
              std::make_shared<const CaseRegistration>(equipment->operation->registration().value());
          const auto live = equipment->operation->live_tool();  // without the models' tunnels
          return [this, registered, live, starts](ApplicationState& state) {
            state.registration = registered;
            state.starts_by_hand = starts;
            state.registered_picks = state.picks;
            state.is_confirmed = false;
            state.nudged.reset();
            for (const operation::OperationTunnel& tunnel : state.tunnels)
              if (tunnel.of_model) state.outcomes.erase(tunnel.name);
            live_tool_ = live ? std::optional(*live) : std::nullopt;
          };
        });
}

void Controller::confirm_registration() {
  if (!equipment_ || !equipment_->operation || !awaits_confirmation(state_) || state_.nudged) return;
  begin(Phase::registration, "confirming the registration", [this, equipment = equipment_]() -> Change {
    value_or_throw(equipment->operation->confirm_registration());
    auto live = equipment->operation->live_tool();
    return [this, live = live ? std::optional(*std::move(live)) : std::nullopt](ApplicationState& state) {
      state.is_confirmed = true;
      live_tool_ = live;
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
  state_.order.reset();
  state_.path = {};
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
