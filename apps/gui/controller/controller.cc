// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/controller.h"

#include <algorithm>

#include <fmt/format.h>

#include "gui/controller/equipment.h"
#include "gui/controller/steps.h"
#include "gui/controller/unsaved_picks.h"
#include "gui/replay/pdf_report.h"
#include "helicarm/core/files.h"
#include "helicarm/operation/plan_fields.h"
#include "helicarm/pipeline/run_case.h"
#include "helicarm/rehearsal/rehearse.h"
#include "helicarm/report/exports.h"
#include "helicarm/report/report.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

constexpr int look_for_images_ms = 100;
constexpr double bone_step_mm = 5;

std::shared_ptr<const pipeline::Result> only(Images images) {
  auto result = std::make_shared<pipeline::Result>();
  result->views = std::move(images);
  return result;
}

std::string first_missing(const ApplicationState& state) {
  for (const pipeline::ViewResult& view : state.result->views)
    if (!view.xray_image) return view.name;
  return state.views.empty() ? "" : state.views.front();
}

void forget_measurement(ApplicationState& state) {
  state.measured = false;
  state.order.reset();
  state.path = {};
  state.outcomes.clear();
  state.refusals.clear();
}

/// Names and bones of a case's tunnels; the two of an ACL reconstruction if it has none.
std::vector<operation::PlannedTunnel> tunnels_of(const pipeline::Case& given) {
  std::vector<operation::PlannedTunnel> tunnels;
  for (const pipeline::TunnelPlan& tunnel : given.tunnels) {
    const auto pick = std::ranges::find(given.picks, tunnel.start, &pipeline::Pick::name);
    const guidance::Bone bone =
        pick == given.picks.end() ? guidance::Bone::femur : pick->moves_with.value_or(guidance::Bone::femur);
    tunnels.push_back({tunnel.name, bone, tunnel.start, tunnel.end});
  }
  if (given.picks.empty() && tunnels.empty())
    tunnels = {{"femur", guidance::Bone::femur, "FS", "FE"}, {"tibia", guidance::Bone::tibia, "TS", "TE"}};
  return tunnels;
}

}  // namespace

Controller::Controller(QObject* parent) : QObject(parent) {
  connect(&images_, &QTimer::timeout, this, &Controller::take_waiting_image);
  images_.start(look_for_images_ms);
}

Controller::~Controller() {
  stop();
  if (equipment_ && equipment_->operation) equipment_->operation->interrupt();
}

void Controller::begin(Phase phase, std::string doing, std::function<Change()> work) {
  if (state_.busy) return;
  state_.busy = phase;
  state_.doing = std::move(doing);
  state_.refusals.erase(phase);
  if (equipment_) equipment_->stopped = false;
  emit changed();
  worker_.post([this, phase, work = std::move(work)] {
    const auto done = guarded([&]() -> Change {
      try {
        return work();
      } catch (const BadInput&) {
        throw;
      } catch (const std::exception& problem) {
        throw BadInput(Reason::unsupported, fmt::format("unexpected: {}", problem.what()));
      }
    });
    QMetaObject::invokeMethod(
        this,
        [this, phase, done] {
          state_.busy.reset();
          state_.doing.clear();
          if (done)
            (*done)(state_);
          else
            state_.refusals.insert_or_assign(phase, done.error());
          emit changed();
          if (!done) emit refused(phase, sentence_of(done.error()));
          if (std::exchange(picks_came_, false)) measure();
        },
        Qt::QueuedConnection);
  });
}

void Controller::meanwhile(Change change) {
  QMetaObject::invokeMethod(
      this,
      [this, change = std::move(change)] {
        change(state_);
        emit changed();
      },
      Qt::QueuedConnection);
}

void Controller::open(Source source, const fs::path& folder, std::string doing,
                      std::function<Change(Equipment&)> work) {
  if (state_.busy) return;
  auto old = std::exchange(equipment_, nullptr);
  live_tool_.reset();
  earlier_picks_.clear();
  later_picks_.clear();
  state_ = ApplicationState{};
  begin(Phase::acquire, std::move(doing),
        [this, source, folder, work = std::move(work), old = std::move(old),
         options = options_]() mutable -> Change {
          old.reset();
          auto equipment = std::make_shared<Equipment>();
          equipment->options = options;
          Change change = work(*equipment);
          return [this, source, folder, equipment, change](ApplicationState& state) {
            equipment_ = equipment;
            state.source = source;
            state.folder = folder;
            change(state);
          };
        });
}

void Controller::start_operation(Equipment& equipment, operation::OperationPlan plan,
                                 const fs::path& folder) {
  equipment.tracker = plan.tracker;
  equipment.operation = value_or_throw(operation::Operation::begin(
      std::move(plan), folder, equipment.devices->board(), equipment.devices->robot(),
      [this](operation::Step, const std::string& what) {
        meanwhile([what](ApplicationState& state) { state.doing = what; });
      }));
  equipment.operation->confirmed_by("the person at the screen");
}

void Controller::open_virtual_or(const virtual_devices::VirtualDevicesOptions& options,
                                 const operation::OperationPlan& wished, const fs::path& folder) {
  const auto work = [=, this, freshness = freshness_](Equipment& equipment) -> Change {
    equipment.virtual_or = value_or_throw(virtual_devices::VirtualDevices::open(options));
    operation::OperationPlan plan =
        rehearsal::plan_for(*equipment.virtual_or, equipment.virtual_or->tracker().port());
    for (const auto& field : operation::plan_fields)
      if (field.get(wished) != field.get(operation::OperationPlan())) field.set(plan, field.get(wished));
    const Json offered = std::exchange(plan.picks, Json::array());
    equipment.devices = std::make_unique<operation::Connections>(
        plan, value_or_throw(receiver::Inbox::open(folder / "inbox")), freshness);
    receiver::ReceiverOptions receiver;
    receiver.port = 0;
    value_or_throw(equipment.devices->listen(receiver));
    start_operation(equipment, plan, folder);
    const auto bones = std::make_shared<const simulation::BoneMeshes>(simulation::moved(
        simulation::bone_meshes(bone_step_mm),
        equipment.virtual_or->simulated_scene().simulated_case().calibrator_from_knee.value()));
    return [change = with_plan(plan, offered), bones](ApplicationState& state) {
      change(state);
      state.bones = bones;
    };
  };
  open(Source::virtual_or, folder, "starting the virtual devices", work);
}

void Controller::open_devices(const fs::path& file, const receiver::ReceiverOptions& receiver,
                              const fs::path& folder) {
  open(Source::devices, folder, "connecting", [=, this](Equipment& equipment) -> Change {
    operation::OperationPlan plan =
        value_or_throw(operation::plan_from(value_or_throw(read_json(file)), file.string()));
    const Json offered = std::exchange(plan.picks, Json::array());
    equipment.devices = std::make_unique<operation::Connections>(
        plan, value_or_throw(receiver::Inbox::open(folder / "inbox")));
    value_or_throw(equipment.devices->listen(receiver));
    start_operation(equipment, plan, folder);
    return with_plan(plan, offered);
  });
}

Controller::Change Controller::with_plan(const operation::OperationPlan& plan, const Json& offered) {
  std::vector<pipeline::CaseView> views(plan.views.size());
  for (std::size_t i = 0; i < views.size(); ++i) views[i].name = plan.views[i];
  const phantom::Calibrator calibrator = value_or_throw(phantom::calibrator_named(plan.calibrator, "."));
  const std::vector<pipeline::Pick> picks = value_or_throw(pipeline::picks_from(offered, "plan", views));
  return [=](ApplicationState& state) {
    state.views = plan.views;
    state.calibrator = calibrator;
    state.tunnels = plan.tunnels;
    for (const auto& point : plan.check_points) state.check_points.push_back(point.name);
    state.offered_picks = picks;
    Images none(plan.views.size());
    for (std::size_t i = 0; i < none.size(); ++i) none[i].name = plan.views[i];
    state.result = only(std::move(none));
    state.next_view = first_missing(state);
  };
}

void Controller::open_case(const fs::path& folder, bool keeps_picks) {
  open(Source::files, folder, "reading " + folder.filename().string(),
       [=, this](Equipment& equipment) -> Change {
         pipeline::Case given = value_or_throw(pipeline::read_case(folder));
         if (!keeps_picks) return with_case(std::move(given), equipment);
         const auto unsaved = unsaved_picks(folder, given.views);
         return [change = with_case(std::move(given), equipment, unsaved.value_or(std::nullopt)), folder,
                 unsaved](ApplicationState& state) {
           change(state);
           if (unsaved)
             state.case_folder = folder;
           else
             state.picks_not_kept = unsaved.error();
         };
       });
}

void Controller::open_images(const std::vector<fs::path>& images) {
  const fs::path folder = images.empty() ? fs::path() : images.front().parent_path();
  open(Source::files, folder, "reading the images", [=, this](Equipment& equipment) {
    return with_case(value_or_throw(case_of_images(images)), equipment);
  });
}

Controller::Change Controller::with_case(pipeline::Case given, Equipment& equipment,
                                         std::optional<Picks> unsaved) {
  equipment.given = given;
  const Change found = measured(equipment, unsaved.value_or(given.picks));
  return [this, given = std::move(given), unsaved = std::move(unsaved), found](ApplicationState& state) {
    for (const pipeline::CaseView& view : given.views) state.views.push_back(view.name);
    state.calibrator = given.calibrator;
    state.tunnels = tunnels_of(given);
    state.picks = unsaved.value_or(given.picks);
    state.has_unsaved_picks = unsaved.has_value();
    if (unsaved) earlier_picks_.push_back(given.picks);
    complete_landmarks(state);
    found(state);
  };
}

void Controller::set_options(const pipeline::RunOptions& options) { options_ = options; }

void Controller::expect(const std::string& view) {
  state_.next_view = view;
  emit changed();
}

void Controller::shoot(const std::string& view) {
  if (!equipment_ || !equipment_->virtual_or) return;
  begin(Phase::acquire, "acquiring " + view, [this, view, equipment = equipment_]() -> Change {
    return came(value_or_throw(shoot_and_take(*equipment, view)));
  });
}

void Controller::take_waiting_image() {
  if (state_.busy || !equipment_ || !equipment_->operation) return;
  const auto view_image = equipment_->devices->next_image(0);
  if (!view_image) return;
  begin(Phase::acquire, "image received",
        [this, view = state_.next_view, equipment = equipment_, view_image]() -> Change {
          return came(value_or_throw(take(*equipment, view, *view_image)));
        });
}

Controller::Change Controller::came(Images images) {
  return [this, images = std::move(images)](ApplicationState& state) {
    forget_measurement(state);
    live_tool_.reset();  // its lines belong to the previous images
    state.result = only(images);
    state.next_view = first_missing(state);
    if (has_all_images()) QMetaObject::invokeMethod(this, &Controller::measure, Qt::QueuedConnection);
  };
}

Controller::Change Controller::measured(Equipment& equipment, const std::vector<pipeline::Pick>& picks) {
  auto result = std::make_shared<const pipeline::Result>(value_or_throw(gui::measure(equipment, picks)));
  std::optional<operation::LiveTool> live;
  if (equipment.operation && !result->failure)
    if (auto follows = equipment.operation->live_tool()) live = *std::move(follows);
  return [this, result, live](ApplicationState& state) {
    forget_measurement(state);
    state.result = result;
    ++state.measurements;
    // A refused tunnel leaves the calibration: its ends can be picked again.
    state.measured =
        !result->views.empty() && std::ranges::all_of(result->views, [](const pipeline::ViewResult& view) {
          return view.calibrated.has_value();
        });
    if (result->failure)
      state.refusals.insert_or_assign(state.measured ? Phase::plan : phase_of(*result->failure),
                                      *result->failure);
    live_tool_ = live;
  };
}

void Controller::measure() {
  if (!equipment_) return;
  picks_came_ = state_.busy == Phase::calibrate;
  begin(Phase::calibrate, "measuring",
        [this, equipment = equipment_, picks = state_.picks, options = options_] {
          equipment->options = options;
          return measured(*equipment, picks);
        });
}

void Controller::change_picks(Picks picks, bool measurable) {
  earlier_picks_.push_back(std::exchange(state_.picks, std::move(picks)));
  later_picks_.clear();
  keep_unsaved_picks();
  picks_changed(measurable);
}

void Controller::step_picks(std::vector<Picks>& from, std::vector<Picks>& to) {
  if (!takes_picks() || from.empty()) return;
  to.push_back(std::exchange(state_.picks, std::move(from.back())));
  from.pop_back();
  keep_unsaved_picks();
  picks_changed(has_all_images());
}

void Controller::keep_unsaved_picks() {
  complete_landmarks(state_);
  if (!state_.case_folder) return;
  state_.has_unsaved_picks = true;
  const auto kept = keep_unsaved(*state_.case_folder, state_.picks);
  state_.picks_not_kept = kept ? std::nullopt : std::optional(kept.error());
}

void Controller::save_picks() {
  if (!state_.case_folder || !takes_picks()) return;
  std::vector<pipeline::TunnelPlan> tunnels;
  for (const operation::PlannedTunnel& tunnel : state_.tunnels)
    tunnels.push_back({tunnel.name, tunnel.start, tunnel.end});
  const auto saved = gui::save_picks(*state_.case_folder, state_.picks, tunnels);
  state_.has_unsaved_picks = !saved;
  state_.picks_not_kept = saved ? std::nullopt : std::optional(saved.error());
  emit changed();
}

void Controller::add_landmark(const std::string& name) {
  if (state_.source != Source::files) return;
  const bool is_taken =
      std::ranges::find(state_.landmarks, name) != state_.landmarks.end() ||
      std::ranges::any_of(state_.tunnels,
                          [&](const operation::PlannedTunnel& tunnel) {
                            return tunnel.start == name || tunnel.end == name;
                          }) ||
      std::ranges::find(state_.calibrator.targets, name, &phantom::CalibratorTarget::name) !=
          state_.calibrator.targets.end();
  if (name.empty() || is_taken)
    return emit refused(Phase::plan, name.empty() ? tr("A landmark needs a name.")
                                                  : tr("There is a point of this name already."));
  state_.landmarks.push_back(name);
  emit changed();
}

bool Controller::has_all_images() const {
  return state_.result && std::ranges::all_of(state_.result->views, [](const pipeline::ViewResult& view) {
           return view.xray_image != nullptr;
         });
}

void Controller::picks_changed(bool measurable) {
  state_.order.reset();
  state_.path = {};
  emit changed();
  if (measurable) measure();
}

bool Controller::takes_picks() const { return !state_.busy || state_.busy == Phase::calibrate; }

void Controller::pick(pipeline::Pick pick) {
  if (!takes_picks()) return;
  Picks picks = state_.picks;
  for (const pipeline::Pick& other : picks)
    if (other.name == pick.name) pick.moves_with = other.moves_with;
  std::erase_if(picks,
                [&](const pipeline::Pick& old) { return old.name == pick.name && old.view == pick.view; });
  const std::string point = pick.name;
  picks.push_back(std::move(pick));
  const bool completes = std::ranges::all_of(state_.views, [&](const std::string& view) {
    return std::ranges::any_of(
        picks, [&](const pipeline::Pick& other) { return other.name == point && other.view == view; });
  });
  change_picks(std::move(picks), completes);  // shows its position and ray gap immediately
}

void Controller::take_offered_picks() {
  if (takes_picks()) change_picks(state_.offered_picks, has_all_images());
}

void Controller::erase_picks(const std::string& point) {
  Picks picks = state_.picks;
  const auto erased = std::erase_if(picks, [&](const pipeline::Pick& pick) { return pick.name == point; });
  if (!takes_picks()) return;
  const auto forgotten = std::erase(state_.landmarks, point);
  if (forgotten > 0 && erased == 0) emit changed();
  if (erased > 0) change_picks(std::move(picks), has_all_images());
}

void Controller::clear_picks() {
  if (takes_picks() && !state_.picks.empty()) change_picks({}, has_all_images());
}

void Controller::cancel() {
  if (!state_.busy || !equipment_) return;
  if (equipment_->devices) return stop();
  equipment_->stopped = true;
}

void Controller::export_to(const fs::path& folder) {
  if (!state_.measured) {
    emit refused(Phase::verify, tr("Nothing to export: measure first."));
    return;
  }
  pipeline::Result result = *state_.result;
  for (const auto& [tunnel, outcome] : state_.outcomes)
    if (outcome.verification) result.verifications.push_back(*outcome.verification);
  begin(Phase::verify, "writing the report", [this, result = std::move(result), folder]() -> Change {
    value_or_throw(report::write_report(result, folder));
    value_or_throw(write_pdf_report(result, folder / "report.pdf"));
    value_or_throw(report::write_exports(result, folder));
    value_or_throw(write_file(folder / "result.json", to_text(pipeline::to_json(result)) + "\n"));
    return [this, folder](ApplicationState&) { emit exported(QString::fromStdString(folder.string())); };
  });
}

void Controller::set_fault(const std::string& name, bool on) {
  if (!equipment_ || !equipment_->virtual_or) return;
  if (const auto of_c_arm = virtual_devices::c_arm_fault(name)) {
    equipment_->c_arm_fault = on ? *of_c_arm : virtual_devices::CArmFault::none;
    return;
  }
  faults_.start(
      [equipment = equipment_, name, on] { static_cast<void>(equipment->virtual_or->set_fault(name, on)); });
}

void Controller::move_bone(const std::string& bone, const Eigen::Vector3d& shift_mm) {
  if (equipment_ && equipment_->virtual_or)
    equipment_->virtual_or->simulated_scene().move_bone(bone, {Eigen::Matrix3d::Identity(), shift_mm});
}

}  // namespace helicarm::gui
