// SPDX-License-Identifier: Apache-2.0
// Registration of a case's models, and moving one by hand.
#include "gui/controller/controller.h"
#include "gui/controller/equipment.h"
#include "gui/controller/model_landmarks.h"
#include "helicarm/case_registration/models_at_starts.h"
#include "helicarm/operation/models.h"

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
    const auto progress = case_registration::progress_in_words(tell, [&] {
      if (equipment.stopped) throw BadInput(Reason::interrupted, "cancelled");
    });
    return value_or_throw(case_registration::register_loaded(
        the_case, case_registration::views_of_calibration(the_case, *equipment.measurement->calibration),
        options, progress, case_registration::located_points_of(*equipment.measurement)));
  });
}

Expected<CaseRegistration> models_at_starts(Equipment& equipment, const pipeline::Result& measured,
                                            const std::vector<pipeline::Pick>& picks,
                                            const ModelLandmarks& landmarks) {
  return guarded([&] {
    const case_registration::Progress progress{.interrupt = [&] {
      if (equipment.stopped) throw BadInput(Reason::interrupted, "cancelled");
    }};
    if (const auto& operation = equipment.operation)
      return value_or_throw(
          operation::models_at_starts(operation->plan(), *operation->measured_case(), measured, progress));
    pipeline::Case the_case = *equipment.the_case;
    the_case.picks = picks;
    start_from_landmarks(the_case, landmarks, {});
    return value_or_throw(case_registration::models_at_starts(
        the_case, case_registration::views_of_calibration(the_case, *measured.calibration), progress));
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
  if (!equipment_ || !can_register(state_) || state_.is_replayed) return;
  if (equipment_->operation) return register_in_operation();
  begin(Phase::registration, "reading the models",
        [this, equipment = equipment_, picks = state_.picks, landmarks = state_.model_landmarks,
         starts = starts_by_hand()]() -> Change {
          const auto tell = [this](const std::string& step) { show_step(step); };
          const auto done = std::make_shared<const CaseRegistration>(
              value_or_throw(gui::register_models(*equipment, picks, landmarks, starts, tell)));
          return [this, done, picks, landmarks, starts](ApplicationState& state) {
            remember_edit(tr("registration"), true);
            state.registration = done;
            state.registered_picks = picks;
            state.registered_landmarks = landmarks;
            state.starts_by_hand = starts;
            state.nudged.reset();
          };
        });
}

void Controller::place_models() {
  if (!equipment_ || !can_register(state_) || state_.is_replayed || movable_models(state_)) return;
  begin(Phase::registration, "reading the models",
        [equipment = equipment_, result = state_.result, picks = state_.picks,
         landmarks = state_.model_landmarks]() -> Change {
          const auto models = std::make_shared<const CaseRegistration>(
              value_or_throw(models_at_starts(*equipment, *result, picks, landmarks)));
          return [models, picks, landmarks](ApplicationState& state) {
            state.at_starts = models;
            state.registered_picks = picks;
            state.registered_landmarks = landmarks;
          };
        });
}

/// With the model that is moved now those that were registered from a pose by hand, or placed, before; none
/// where no model is moved or placed.
std::vector<operation::ModelStart> Controller::starts_by_hand() const {
  if (!has_poses_by_hand(state_)) return {};
  std::vector<operation::ModelStart> starts = state_.starts_by_hand;
  if (!state_.nudged) return starts;
  const std::string& name = state_.models.at(state_.nudged->model).name;
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
            forget_registrations();
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
  const auto models = movable_models(state_);
  if (state_.busy || state_.is_replayed || !models || model >= models->models.size()) return;
  const bool is_there =
      state_.nudged ? state_.nudged->model == model && state_.nudged->step == step : step.isZero(0);
  if (is_there) return;
  const case_registration::RegisteredModel& registered = models->models[model];
  if (!step.isZero(0) && !registered.model) return;
  const bool leaves_other = state_.nudged && state_.nudged->model != model;
  const bool other_stays = leaves_other && !state_.registration;
  const bool is_choice = leaves_other && step.isZero(0);  // of this model: none but the other one moves
  if (!continues && !(is_choice && other_stays))
    remember_edit(tr("move of %1")
                      .arg(QString::fromStdString(
                          models->models[is_choice ? state_.nudged->model : model].registration.name)),
                  true);
  if (other_stays) leave_where_placed();
  const registration::Registration& from = registered.registration;
  Outlines until_then = state_.nudged && state_.nudged->model == model ? std::move(state_.nudged->outlines)
                                                                       : registered.outlines;
  state_.nudged.reset();
  if (!step.isZero(0))
    state_.nudged = {model, step, registration::moved_about(from.world_from_model, from.centre, step),
                     std::move(until_then)};
  state_.order.reset();
  state_.path = {};
  emit changed();
  if (!outlining_) outline_nudged();
}

void Controller::return_models() {
  if (state_.busy || state_.is_replayed || !has_poses_by_hand(state_)) return;
  remember_edit(tr("models moved back"), true);
  state_.nudged.reset();
  if (!state_.registration && !std::exchange(state_.starts_by_hand, {}).empty()) state_.at_starts.reset();
  state_.order.reset();
  state_.path = {};
  emit changed();
}

void Controller::leave_where_placed() {
  state_.starts_by_hand = starts_by_hand();
  auto models = std::make_shared<CaseRegistration>(*state_.at_starts);
  case_registration::RegisteredModel& placed = models->models[state_.nudged->model];
  placed.registration.world_from_model = state_.nudged->world_from_model;
  placed.registration.centre = state_.nudged->world_from_model * placed.model->centre;
  placed.outlines = outlining_ ? Outlines{} : std::move(state_.nudged->outlines);
  state_.at_starts = std::move(models);
  state_.nudged.reset();
}

void Controller::forget_old_starts() {
  if (has_old_starts(state_) && !has_poses_by_hand(state_)) state_.at_starts.reset();
}

std::optional<NudgedModel> Controller::not_outlined() const {
  const std::size_t placed = state_.registration || !state_.at_starts ? 0 : state_.at_starts->models.size();
  for (std::size_t i = 0; i < placed; ++i) {
    const case_registration::RegisteredModel& model = state_.at_starts->models[i];
    const bool is_nudged = state_.nudged && state_.nudged->model == i;
    if (model.model && model.outlines.empty() && !is_nudged)
      return NudgedModel{i, registration::RigidStep::Zero(), model.registration.world_from_model, {}};
  }
  return state_.nudged;
}

void Controller::take_outlines(const NudgedModel& of, const Outlines& outlines) {
  if (state_.nudged && state_.nudged->model == of.model) {
    state_.nudged->outlines = outlines;
  } else if (const auto other = not_outlined(); other && same_place(*other, of)) {
    auto models = std::make_shared<CaseRegistration>(*state_.at_starts);
    models->models[of.model].outlines = outlines;
    state_.at_starts = std::move(models);
  }
}

void Controller::outline_nudged() {
  const auto next = not_outlined();
  outlining_ = next && !state_.busy;
  if (!outlining_) return;
  worker_.post([this, models = movable_models(state_), of = *next] {
    const case_registration::RegisteredModel& registered = models->models[of.model];
    const auto outlines = guarded([&] {
      return case_registration::outlines(*registered.model, registered.views, of.world_from_model);
    });
    QMetaObject::invokeMethod(
        this,
        [this, of, outlines] {
          if (outlines) take_outlines(of, *outlines);
          outlining_ = false;
          const auto next = not_outlined();
          if (!next || !same_place(*next, of)) outline_nudged();
          emit changed();
        },
        Qt::QueuedConnection);
  });
}

}  // namespace helicarm::gui
