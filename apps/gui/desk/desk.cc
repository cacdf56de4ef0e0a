// SPDX-License-Identifier: Apache-2.0
#include "gui/desk/desk.h"

#include <algorithm>

#include <fmt/format.h>

#include "gui/desk/room.h"
#include "gui/desk/steps.h"
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

constexpr int look_for_pictures_ms = 100;
constexpr double bone_step_mm = 5;

std::shared_ptr<const Result> only(Pictures pictures) {
  auto result = std::make_shared<Result>();
  result->views = std::move(pictures);
  return result;
}

std::string first_missing(const DeskState& state) {
  for (const ViewResult& view : state.result->views)
    if (!view.exposure) return view.name;
  return state.views.empty() ? "" : state.views.front();
}

void forget_measurement(DeskState& state) {
  state.measured = false;
  state.order.reset();
  state.path = {};
  state.outcomes.clear();
  state.refusals.clear();
}

/// Names and bones of a case's tunnels; without any, the two of an ACL operation.
std::vector<PlannedTunnel> tunnels_of(const Case& given) {
  std::vector<PlannedTunnel> tunnels;
  for (const TunnelPlan& tunnel : given.tunnels) {
    const auto pick = std::ranges::find(given.picks, tunnel.start, &Pick::name);
    const Bone bone = pick == given.picks.end() ? Bone::femur : pick->moves_with.value_or(Bone::femur);
    tunnels.push_back({tunnel.name, bone, tunnel.start, tunnel.end});
  }
  if (given.picks.empty() && tunnels.empty())
    tunnels = {{"femur", Bone::femur, "FS", "FE"}, {"tibia", Bone::tibia, "TS", "TE"}};
  return tunnels;
}

}  // namespace

Desk::Desk(QObject* parent) : QObject(parent) {
  connect(&pictures_, &QTimer::timeout, this, &Desk::take_waiting_picture);
  pictures_.start(look_for_pictures_ms);
}

Desk::~Desk() {
  stop();
  if (room_ && room_->operation) room_->operation->interrupt();
}

void Desk::begin(Phase phase, std::string doing, std::function<Change()> work) {
  if (state_.busy) return;
  state_.busy = phase;
  state_.doing = std::move(doing);
  state_.refusals.erase(phase);
  if (room_) room_->stopped = false;
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

void Desk::meanwhile(Change change) {
  QMetaObject::invokeMethod(
      this,
      [this, change = std::move(change)] {
        change(state_);
        emit changed();
      },
      Qt::QueuedConnection);
}

void Desk::open(Source source, const fs::path& folder, std::string doing, std::function<Change(Room&)> work) {
  if (state_.busy) return;
  auto old = std::exchange(room_, nullptr);
  live_tool_.reset();
  state_ = DeskState{};
  begin(Phase::acquire, std::move(doing),
        [this, source, folder, work = std::move(work), old = std::move(old),
         options = options_]() mutable -> Change {
          old.reset();
          auto room = std::make_shared<Room>();
          room->options = options;
          Change change = work(*room);
          return [this, source, folder, room, change](DeskState& state) {
            room_ = room;
            state.source = source;
            state.folder = folder;
            change(state);
          };
        });
}

void Desk::start_operation(Room& room, OperationPlan plan, const fs::path& folder) {
  room.tracker = plan.tracker;
  room.operation =
      value_or_throw(Operation::begin(std::move(plan), folder, room.devices->board(), room.devices->robot(),
                                      [this](Step, const std::string& what) {
                                        meanwhile([what](DeskState& state) { state.doing = what; });
                                      }));
  room.operation->confirmed_by("the person at the screen");
}

void Desk::open_room(const operating_room::VirtualRoomOptions& options, const OperationPlan& wished,
                     const fs::path& folder) {
  const auto work = [=, this, freshness = freshness_](Room& room) -> Change {
    room.virtual_room = value_or_throw(operating_room::VirtualRoom::open(options));
    OperationPlan plan = plan_for(*room.virtual_room, room.virtual_room->tracker().port());
    for (const auto& field : plan_fields)
      if (field.get(wished) != field.get(OperationPlan())) field.set(plan, field.get(wished));
    const Json offered = std::exchange(plan.picks, Json::array());
    room.devices =
        std::make_unique<Connections>(plan, value_or_throw(Inbox::open(folder / "inbox")), freshness);
    ReceiverOptions receiver;
    receiver.port = 0;
    value_or_throw(room.devices->listen(receiver));
    start_operation(room, plan, folder);
    const auto bones = std::make_shared<const simulation::BoneMeshes>(
        simulation::moved(simulation::bone_meshes(bone_step_mm),
                          room.virtual_room->theatre().room().calibrator_from_knee.value()));
    return [change = with_plan(plan, offered), bones](DeskState& state) {
      change(state);
      state.bones = bones;
    };
  };
  open(Source::virtual_room, folder, "opening the virtual operating room", work);
}

void Desk::open_devices(const fs::path& file, const ReceiverOptions& receiver, const fs::path& folder) {
  open(Source::devices, folder, "connecting", [=, this](Room& room) -> Change {
    OperationPlan plan = value_or_throw(plan_from(value_or_throw(read_json(file)), file.string()));
    const Json offered = std::exchange(plan.picks, Json::array());
    room.devices = std::make_unique<Connections>(plan, value_or_throw(Inbox::open(folder / "inbox")));
    value_or_throw(room.devices->listen(receiver));
    start_operation(room, plan, folder);
    return with_plan(plan, offered);
  });
}

Desk::Change Desk::with_plan(const OperationPlan& plan, const Json& offered) {
  std::vector<CaseView> views(plan.views.size());
  for (std::size_t i = 0; i < views.size(); ++i) views[i].name = plan.views[i];
  const Calibrator calibrator = value_or_throw(calibrator_named(plan.calibrator, "."));
  const std::vector<Pick> picks = value_or_throw(picks_from(offered, "plan", views));
  return [=](DeskState& state) {
    state.views = plan.views;
    state.calibrator = calibrator;
    state.tunnels = plan.tunnels;
    for (const auto& point : plan.check_points) state.check_points.push_back(point.name);
    state.offered_picks = picks;
    Pictures none(plan.views.size());
    for (std::size_t i = 0; i < none.size(); ++i) none[i].name = plan.views[i];
    state.result = only(std::move(none));
    state.next_view = first_missing(state);
  };
}

void Desk::open_case(const fs::path& folder) {
  open(Source::files, folder, "reading " + folder.filename().string(),
       [=, this](Room& room) { return with_case(value_or_throw(read_case(folder)), room); });
}

void Desk::open_pictures(const std::vector<fs::path>& pictures) {
  const fs::path folder = pictures.empty() ? fs::path() : pictures.front().parent_path();
  open(Source::files, folder, "reading the pictures",
       [=, this](Room& room) { return with_case(value_or_throw(case_of_pictures(pictures)), room); });
}

Desk::Change Desk::with_case(Case given, Room& room) {
  room.given = given;
  const Change found = measured(room, given.picks);
  return [given = std::move(given), found](DeskState& state) {
    for (const CaseView& view : given.views) state.views.push_back(view.name);
    state.calibrator = given.calibrator;
    state.tunnels = tunnels_of(given);
    state.picks = given.picks;
    found(state);
  };
}

void Desk::set_options(const RunOptions& options) { options_ = options; }

void Desk::expect(const std::string& view) {
  state_.next_view = view;
  emit changed();
}

void Desk::shoot(const std::string& view) {
  if (!room_ || !room_->virtual_room) return;
  begin(Phase::acquire, "shooting " + view,
        [this, view, room = room_]() -> Change { return came(value_or_throw(shoot_and_take(*room, view))); });
}

void Desk::take_waiting_picture() {
  if (state_.busy || !room_ || !room_->operation) return;
  const auto picture = room_->devices->next_picture(0);
  if (!picture) return;
  begin(Phase::acquire, "a picture came", [this, view = state_.next_view, room = room_, picture]() -> Change {
    return came(value_or_throw(take(*room, view, *picture)));
  });
}

Desk::Change Desk::came(Pictures pictures) {
  return [this, pictures = std::move(pictures)](DeskState& state) {
    forget_measurement(state);
    live_tool_.reset();  // its lines belong to the former pictures
    state.result = only(pictures);
    state.next_view = first_missing(state);
    if (std::ranges::all_of(state.result->views, [](const ViewResult& v) { return v.exposure != nullptr; }))
      QMetaObject::invokeMethod(this, &Desk::measure, Qt::QueuedConnection);
  };
}

Desk::Change Desk::measured(Room& room, const std::vector<Pick>& picks) {
  auto result = std::make_shared<const Result>(value_or_throw(gui::measure(room, picks)));
  std::optional<LiveTool> live;
  if (room.operation && !result->failure)
    if (auto follows = room.operation->live_tool()) live = *std::move(follows);
  return [this, result, live](DeskState& state) {
    forget_measurement(state);
    state.result = result;
    ++state.measurements;
    state.measured = !result->failure;
    if (result->failure) state.refusals.insert_or_assign(phase_of(*result->failure), *result->failure);
    live_tool_ = live;
  };
}

void Desk::measure() {
  if (!room_) return;
  picks_came_ = state_.busy == Phase::calibrate;
  begin(Phase::calibrate, "measuring", [this, room = room_, picks = state_.picks, options = options_] {
    room->options = options;
    return measured(*room, picks);
  });
}

void Desk::picks_changed(bool measurable) {
  state_.order.reset();
  state_.path = {};
  emit changed();
  if (measurable) measure();
}

bool Desk::is_whole(const std::string& point) const {
  return std::ranges::all_of(state_.views,
                             [&](const std::string& view) { return pick_of(state_, point, view); });
}

bool Desk::takes_picks() const { return !state_.busy || state_.busy == Phase::calibrate; }

void Desk::pick(Pick pick) {
  if (!takes_picks()) return;
  std::erase_if(state_.picks,
                [&](const Pick& old) { return old.name == pick.name && old.view == pick.view; });
  const std::string point = pick.name;
  state_.picks.push_back(std::move(pick));
  picks_changed(is_whole(point));  // its place and how far its rays miss show at once
}

void Desk::take_offered_picks() {
  if (state_.busy) return;
  state_.picks = state_.offered_picks;
  picks_changed(!next_pick(state_));
}

void Desk::clear_picks() {
  if (state_.busy) return;
  state_.picks.clear();
  picks_changed(!next_pick(state_));
}

void Desk::cancel() {
  if (!state_.busy || !room_) return;
  if (room_->devices) return stop();
  room_->stopped = true;
}

void Desk::export_to(const fs::path& folder) {
  if (!state_.measured) {
    emit refused(Phase::verify, tr("Nothing is measured yet: there is nothing to export."));
    return;
  }
  Result result = *state_.result;
  for (const auto& [tunnel, outcome] : state_.outcomes)
    if (outcome.verification) result.verifications.push_back(*outcome.verification);
  begin(Phase::verify, "writing the report", [this, result = std::move(result), folder]() -> Change {
    value_or_throw(write_report(result, folder));
    value_or_throw(write_pdf_report(result, folder / "report.pdf"));
    value_or_throw(write_exports(result, folder));
    value_or_throw(write_file(folder / "result.json", to_text(to_json(result)) + "\n"));
    return [this, folder](DeskState&) { emit exported(QString::fromStdString(folder.string())); };
  });
}

void Desk::set_fault(const std::string& name, bool on) {
  if (!room_ || !room_->virtual_room) return;
  if (const auto of_c_arm = operating_room::c_arm_fault(name)) {
    room_->c_arm_fault = on ? *of_c_arm : operating_room::CArmFault::none;
    return;
  }
  errands_.start([room = room_, name, on] { static_cast<void>(room->virtual_room->set_fault(name, on)); });
}

void Desk::move_bone(const std::string& bone, const Eigen::Vector3d& shift_mm) {
  if (room_ && room_->virtual_room)
    room_->virtual_room->theatre().move_bone(bone, {Eigen::Matrix3d::Identity(), shift_mm});
}

}  // namespace helicarm::gui
