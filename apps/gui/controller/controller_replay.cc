// SPDX-License-Identifier: Apache-2.0
// Measurements of a recorded operation, with the registrations of its models.
#include <fmt/format.h>

#include "gui/controller/controller.h"
#include "gui/controller/equipment.h"
#include "helicarm/operation/earlier_versions.h"
#include "helicarm/operation/models.h"

namespace helicarm::gui {

void Controller::show_recorded(RecordedMoment moment) {
  const std::filesystem::path& folder = moment.case_folder;
  const bool is_open = state_.asked_for == folder &&
                       (state_.is_replayed || (opens_recorded_ && state_.busy == Phase::acquire));
  recorded_ = std::move(moment);
  if (!is_open) return open_recorded();
  next_source_ = nullptr;
  registers_recorded_ = true;
  follow_record();
}

void Controller::show_unregistered() {
  if (!recorded_) return;
  recorded_->models.reset();
  recorded_->is_confirmed = false;
  follow_record();
}

void Controller::open_recorded() {
  if (state_.busy) {
    next_source_ = [this] { open_recorded(); };
    return cancel();
  }
  const std::filesystem::path folder = recorded_->case_folder;
  open(Source::files, folder, "reading " + folder.filename().string(),
       [this, folder, plan = recorded_->plan](Equipment& equipment) -> Change {
         equipment.is_recorded = true;
         equipment.options = operation::measuring_options(plan);
         const Change opened = with_case(value_or_throw(pipeline::read_case(folder)), equipment);
         return [this, plan, opened](ApplicationState& state) {
           opened(state);
           as_recorded_ = {};  // other files, or changed ones
           registers_recorded_ = true;
           state.is_replayed = true;
           state.tunnels = plan.tunnels;
           state.landmarks.clear();
           complete_landmarks(state);
           state.stand_off_mm = plan.robot.approach.stand_off_mm;
           state.drill = plan.drill;
           state.has_models = !plan.models.empty();
           state.models = plan.models;
         };
       });
  opens_recorded_ = true;
}

void Controller::follow_record() {
  if (state_.busy || !recorded_ || !state_.is_replayed || !state_.measured ||
      state_.folder != recorded_->case_folder)
    return;
  const auto& wanted = recorded_->models;
  if (wanted && as_recorded_.digest != wanted->digest) {
    if (registers_recorded_) register_as_recorded();
    return;
  }
  const auto shown = wanted ? as_recorded_.done.value_or(nullptr) : nullptr;
  const std::shared_ptr<const case_registration::CaseRegistration> registration(
      shown, shown ? &shown->registration : nullptr);
  const bool is_confirmed = registration && recorded_->is_confirmed;
  const bool is_refused = wanted && !as_recorded_.done;
  if (registration == state_.registration && is_confirmed == state_.is_confirmed &&
      is_refused == state_.refusals.contains(Phase::registration))
    return;
  const bool is_new = registration && registration != state_.registration;
  state_.registration = registration;
  state_.is_confirmed = is_confirmed;
  state_.registered_picks = equipment_->the_case->picks;
  state_.refusals.erase(Phase::registration);
  if (is_refused) state_.refusals.emplace(Phase::registration, as_recorded_.done.error());
  emit changed();
  if (is_new && shown->note)
    emit told(
        tr("%1: %2.").arg(QString::fromStdString(wanted->folder), QString::fromStdString(*shown->note)));
}

void Controller::register_as_recorded() {
  state_.registration.reset();  // of another moment
  state_.is_confirmed = false;
  begin(Phase::registration, "registering the models as recorded",
        [this, equipment = equipment_, plan = recorded_->plan, then = *recorded_->models]() -> Change {
          const auto tell = [this](const std::string& step) { show_step(step); };
          const auto progress = case_registration::progress_in_words(tell, [&] {
            if (equipment->stopped) throw BadInput(Reason::interrupted, "cancelled");
          });
          const auto done = guarded([&] {
            const pipeline::Case& the_case = *equipment->the_case;
            const auto measured =
                value_or_throw(operation::measure_by_plan(the_case, plan, equipment->measurement));
            auto found = operation::as_recorded(
                value_or_throw(operation::register_models(plan, the_case, measured, progress, then.starts)),
                then.digest);
            if (!found)
              throw BadInput(Reason::replay_differs,
                             fmt::format("{0}: the files of the session give another registration than the "
                                         "recorded one, whose report is {0}/report.html",
                                         then.folder));
            return std::make_shared<const operation::RecordedRegistration>(*std::move(found));
          });
          if (!done && done.error().reason == Reason::interrupted) throw BadInput(done.error());
          return [this, digest = then.digest, done](ApplicationState&) { as_recorded_ = {digest, done}; };
        });
}

}  // namespace helicarm::gui
