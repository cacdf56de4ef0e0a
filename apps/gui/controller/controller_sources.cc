// SPDX-License-Identifier: Apache-2.0
// What is opened: an operation with virtual or real devices, a case, or image files.
#include <algorithm>

#include "gui/controller/controller.h"
#include "gui/controller/equipment.h"
#include "gui/controller/model_landmarks.h"
#include "gui/controller/pick_checks.h"
#include "gui/controller/unsaved_changes.h"
#include "gui/controller/unsaved_picks.h"
#include "helicarm/core/private_files.h"
#include "helicarm/operation/plan_fields.h"
#include "helicarm/pipeline/case_purpose.h"
#include "helicarm/rehearsal/ct_plan.h"
#include "helicarm/rehearsal/rehearse.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

constexpr double bone_step_mm = 5;

/// Names and bones of a case's tunnels; the two of an ACL reconstruction if it has the knee's calibrator and
/// neither tunnels nor models, nor picks of other points only.
std::vector<operation::OperationTunnel> tunnels_of(const pipeline::Case& the_case,
                                                   const std::vector<pipeline::Pick>& unsaved) {
  std::vector<operation::OperationTunnel> tunnels;
  for (const pipeline::CaseTunnel& tunnel : the_case.tunnels) {
    const auto pick = std::ranges::find(the_case.picks, tunnel.start, &pipeline::Pick::name);
    const auto bone = pick == the_case.picks.end() ? std::nullopt : pick->moves_with;
    tunnels.push_back({tunnel.name, bone.value_or(guidance::Bone()), tunnel.start, tunnel.end});
  }
  const bool is_of_the_knee =
      the_case.bones == guidance::knee_bones() && the_case.calibrator.name == phantom::udcsc().name;
  if (!the_case.picks.empty() || !tunnels.empty() || !the_case.models.empty() || !is_of_the_knee)
    return tunnels;
  tunnels = {{"femur", "femur", "FS", "FE", operation::TunnelEnd::end}, {"tibia", "tibia", "TS", "TE"}};
  ApplicationState picked;
  picked.picks = unsaved;
  const bool has_none =
      std::ranges::all_of(tunnels, [&](const auto& tunnel) { return is_unpicked(picked, tunnel); });
  return unsaved.empty() || !has_none ? tunnels : std::vector<operation::OperationTunnel>{};
}

/// Every file of the folder that a JSON value names.
void add_files(const Json& json, const fs::path& folder, QStringList& files) {
  std::error_code unreadable;
  if (json.is_string()) {
    const fs::path file = folder / json.get<std::string>();
    if (fs::is_regular_file(file, unreadable)) files << QString::fromStdString(file.string());
  } else if (json.is_structured()) {
    for (const Json& part : json) add_files(part, folder, files);
  }
}

/// Every folder of images that a JSON value names, and the files in it.
void add_series(const Json& json, const fs::path& folder, QStringList& paths) {
  std::error_code unreadable;
  if (json.is_string() && !json.get<std::string>().empty()) {
    const fs::path series = folder / json.get<std::string>();
    if (!fs::is_directory(series, unreadable) || fs::equivalent(series, folder, unreadable)) return;
    paths << QString::fromStdString(series.string());
    for (const fs::directory_entry& entry : fs::directory_iterator(series, unreadable))
      if (entry.is_regular_file(unreadable)) paths << QString::fromStdString(entry.path().string());
  } else if (json.is_structured()) {
    for (const Json& part : json) add_series(part, folder, paths);
  }
}

/// What the operation reports of a step follows.
std::string words_of(operation::Step step) {
  switch (step) {
    case operation::Step::acquire:
      return "acquiring: ";
    case operation::Step::measure:
      return "measuring: ";
    case operation::Step::register_robot:
      return "registering the robot: ";
    case operation::Step::plan:
      return "planning the path to ";
    case operation::Step::navigate:
      return "to the tunnel: ";
    case operation::Step::verify:
      return "verifying the tool at ";
  }
  return {};
}

}  // namespace

void Controller::open(Source source, const fs::path& folder, std::string doing,
                      std::function<Change(Equipment&)> work) {
  if (state_.busy) {
    next_source_ = [=, this] { open(source, folder, doing, work); };
    return cancel();
  }
  if (const UnsavedChanges changes = unsaved_changes(state_); changes.any() && !state_.picks_not_kept)
    emit told(
        tr("The changes of %1 that are not in its case.json are kept in %2.")
            .arg(QString::fromStdString(state_.case_folder->string()), changes.files().join(tr(" and "))));
  auto old = std::exchange(equipment_, nullptr);
  opens_recorded_ = false;
  live_tool_.reset();
  earlier_.clear();
  later_.clear();
  watch_no_files();
  state_ = ApplicationState{};
  state_.asked_for = folder;
  if (source == Source::files) watch_files_of(folder);  // also what changes while it is read
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
  const auto notify = [this](operation::Step step, const std::string& what) {
    show_step(words_of(step) + what);
  };
  const tracker::PoseBoard& board = equipment.devices->board();
  equipment.operation =
      value_or_throw(plan.drill ? operation::Operation::begin_freehand(std::move(plan), folder, board, notify)
                                : operation::Operation::begin(std::move(plan), folder, board,
                                                              equipment.devices->robot(), notify));
  equipment.operation->confirmed_by("the person at the screen");
}

void Controller::open_virtual_or(const virtual_devices::VirtualDevicesOptions& options,
                                 const operation::OperationPlan& wished, const fs::path& folder, bool by_ct) {
  const auto work = [=, this, freshness = freshness_](Equipment& equipment) -> Change {
    equipment.virtual_or = value_or_throw(virtual_devices::VirtualDevices::open(options));
    operation::OperationPlan plan =
        rehearsal::plan_for(*equipment.virtual_or, equipment.virtual_or->tracker().port());
    for (const auto& field : operation::plan_fields)
      if (field.get(wished) != field.get(operation::OperationPlan())) field.set(plan, field.get(wished));
    if (by_ct) {
      const fs::path ct = folder.parent_path() / (folder.filename().string() + "-ct");
      value_or_throw(make_private_folder(ct));
      plan = rehearsal::with_ct_plan(std::move(plan),
                                     equipment.virtual_or->simulated_scene().simulated_case(), ct);
    }
    const auto offered = std::exchange(plan.picks, {});
    equipment.devices = std::make_unique<operation::Connections>(
        plan, value_or_throw(receiver::Inbox::open(folder / "inbox")),
        freshness.value_or(operation::freshness_limits(plan.tracker)));
    receiver::ReceiverOptions receiver;
    receiver.port = 0;
    value_or_throw(equipment.devices->listen(receiver));
    start_operation(equipment, plan, folder);
    const auto bones = std::make_shared<const simulation::BoneMeshes>(simulation::moved(
        simulation::bone_meshes(bone_step_mm),
        equipment.virtual_or->simulated_scene().simulated_case().calibrator_from_knee.value()));
    return [change = with_plan(plan, equipment.operation->plan().models, offered),
            bones](ApplicationState& state) {
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
    const auto offered = std::exchange(plan.picks, {});
    equipment.devices = std::make_unique<operation::Connections>(
        plan, value_or_throw(receiver::Inbox::open(folder / "inbox")));
    value_or_throw(equipment.devices->listen(receiver));
    start_operation(equipment, plan, folder);
    return with_plan(plan, equipment.operation->plan().models, offered);
  });
}

Controller::Change Controller::with_plan(const operation::OperationPlan& plan,
                                         const std::vector<pipeline::CaseModel>& models,
                                         const std::vector<pipeline::Pick>& offered) {
  const phantom::Calibrator calibrator = value_or_throw(operation::files_of(plan)).calibrator;
  return [=](ApplicationState& state) {
    state.views = plan.views;
    state.calibrator = calibrator;
    state.tunnels = plan.tunnels;
    for (const auto& point : plan.check_points) state.check_points.push_back(point.name);
    state.drill = plan.drill;
    state.stand_off_mm = plan.robot.approach.stand_off_mm;
    state.offered_picks = offered;
    state.has_models = !models.empty();
    state.models = models;
    Images none(plan.views.size());
    for (std::size_t i = 0; i < none.size(); ++i) none[i].name = plan.views[i];
    state.result = result_with(std::move(none));
    state.next_view = missing_view(state);
  };
}

void Controller::open_case(const fs::path& folder, bool keeps_picks) {
  open(Source::files, folder, "reading " + folder.filename().string(),
       [=, this](Equipment& equipment) -> Change {
         pipeline::Case the_case = value_or_throw(pipeline::read_any_case(folder));
         if (pipeline::brings_cameras(the_case))
           the_case.calibrator = {};  // of another world, and not looked for
         if (!keeps_picks)
           return [this, landmarks = opened_landmarks(the_case, false),
                   change = with_case(std::move(the_case), equipment)](ApplicationState& state) {
             change(state);
             take_landmarks(landmarks);
           };
         const auto unsaved = unsaved_picks(folder, the_case);
         const OpenedLandmarks landmarks = opened_landmarks(the_case, true);
         return [this, change = with_case(std::move(the_case), equipment, unsaved.value_or(std::nullopt)),
                 folder, unsaved, landmarks](ApplicationState& state) {
           change(state);
           if (unsaved)
             state.case_folder = folder;
           else
             state.picks_not_kept = unsaved.error();
           if (unsaved && *unsaved)
             emit told(
                 tr("Picks that are not in case.json are restored: Ctrl+S saves them, Ctrl+Z takes those "
                    "of case.json."));
           take_landmarks(landmarks);
         };
       });
}

void Controller::watch_files_of(const fs::path& case_folder) {
  const fs::path file = case_folder / "case.json";
  watched_ = {QString::fromStdString(file.string())};
  if (const auto json = read_json(file)) {
    add_files(*json, case_folder, watched_);
    if (json->is_object() && json->contains("models")) add_series(json->at("models"), case_folder, watched_);
  }
  watched_.removeDuplicates();
  files_.addPaths(watched_);
}

void Controller::watch_no_files() {
  if (!watched_.isEmpty()) files_.removePaths(watched_);
  watched_.clear();
}

void Controller::open_images(const std::vector<fs::path>& files) {
  const fs::path folder = files.empty() ? fs::path() : files.front().parent_path();
  open(Source::images, folder, "reading the images", [files](Equipment&) -> Change {
    return [loose = value_or_throw(read_loose_images(files))](ApplicationState& state) {
      for (const pipeline::ViewResult& view : loose.images) state.views.push_back(view.name);
      state.files = loose.files;
      state.result = result_with(loose.images);
      if (loose.unreadable) state.refusals.insert_or_assign(Phase::acquire, *loose.unreadable);
    };
  });
}

QString Controller::loss() const {
  const bool has_images = state_.result && std::ranges::any_of(state_.result->views, [](const auto& view) {
                            return view.xray_image != nullptr;
                          });
  if (is_operation(state_) && (has_images || state_.busy))
    return tr("End this operation? Its record is kept.");
  const bool has_other_picks = std::ranges::any_of(earlier_, [&](const Edit& edit) {
    return !are_same(edit.picks, state_.picks) || !are_same(edit.model_landmarks, state_.model_landmarks);
  });
  if (has_other_picks && (state_.picks_not_kept || !state_.case_folder))
    return tr("The changed picks or landmarks are not kept in a file. Discard them?");
  return {};
}

Controller::Change Controller::with_case(pipeline::Case the_case, Equipment& equipment,
                                         std::optional<Picks> unsaved) {
  equipment.the_case = the_case;
  const std::vector<ViewFile> files = files_of(the_case);
  const Change found = measured(equipment, unsaved.value_or(the_case.picks));
  return [this, the_case = std::move(the_case), unsaved = std::move(unsaved), files,
          found](ApplicationState& state) {
    for (const pipeline::CaseView& view : the_case.views) state.views.push_back(view.name);
    state.files = files;
    state.calibrator = the_case.calibrator;
    for (const pipeline::CaseView& view : the_case.views)
      if (view.camera) state.cameras.push_back(*view.camera);
    state.tunnels = tunnels_of(the_case, unsaved.value_or(the_case.picks));
    state.picks = unsaved.value_or(the_case.picks);
    state.has_unsaved_picks = unsaved.has_value();
    if (unsaved) {
      earlier_.push_back(edit_named(tr("the restored picks")));
      earlier_.back().picks = the_case.picks;
    }
    for (const guidance::ToolLine& line : the_case.tool_lines) state.tool_lines.push_back(line.tunnel);
    complete_landmarks(state);
    found(state);
    state.has_models = !the_case.models.empty();
    state.models = the_case.models;
  };
}

}  // namespace helicarm::gui
