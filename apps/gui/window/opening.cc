// SPDX-License-Identifier: Apache-2.0
// What the window opens, and what it asks before.
#include <QCloseEvent>
#include <QDateTime>
#include <QDockWidget>
#include <QDragEnterEvent>
#include <QMessageBox>
#include <QMimeData>
#include <algorithm>
#include <array>
#include <fstream>
#include <string_view>

#include "gui/controller/equipment.h"
#include "gui/controller/stale.h"
#include "gui/controller/unsaved_changes.h"
#include "gui/window/ask_files.h"
#include "gui/window/bones_window.h"
#include "gui/window/main_window.h"
#include "gui/window/run_window.h"
#include "gui/window/sequence_window.h"
#include "gui/xray/text.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

/// By its name, or as DICOM, which often has no extension.
bool may_be_image(const fs::path& file) {
  const QString kind = QString::fromStdString(file.extension().string()).toLower();
  if (QStringList{".dcm", ".dicom", ".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp"}.contains(kind))
    return true;
  constexpr std::size_t preamble = 128;
  std::array<char, preamble + 4> head{};
  std::ifstream(file, std::ios::binary).read(head.data(), head.size());
  return std::string_view(head.data() + preamble, 4) == "DICM";
}

/// X-ray images in a folder without a case.json, by name.
std::vector<fs::path> images_in(const fs::path& folder) {
  std::vector<fs::path> images;
  std::error_code unreadable;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, unreadable))
    if (entry.is_regular_file(unreadable) && may_be_image(entry.path())) images.push_back(entry.path());
  std::ranges::sort(images);
  return images;
}

/// Along its axis to where the tunnel enters the bone.
std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>> approach_of(const registration::BoneCheck& check,
                                                                       double stand_off_mm) {
  if (!check.entry) return std::nullopt;
  const Eigen::Vector3d out = (*check.entry - check.end).normalized();
  return std::pair<Eigen::Vector3d, Eigen::Vector3d>(*check.entry + stand_off_mm * out, *check.entry);
}

/// What the present registration plans in the CT of a model.
CtPlan plan_in_ct(const ApplicationState& state, std::size_t model) {
  CtPlan plan;
  if (!state.registration || model >= state.registration->models.size()) return plan;
  const case_registration::RegisteredModel& registered = state.registration->models[model];
  if (!stale_model(state, model).isEmpty() || registered.registration.failure) return plan;
  const geometry::RigidTransform model_from_world = registered.registration.world_from_model.inverse();
  for (std::size_t i = 0; i < registered.tunnel_ends.size(); ++i) {
    const auto& [start, end] = registered.tunnel_ends[i];
    plan.tunnels.push_back({registered.tunnels[i].name,
                            model_from_world * registered.points[start].place.in_calibrator,
                            model_from_world * registered.points[end].place.in_calibrator});
    if (i < registered.bone_checks.size() && registered.bone_checks[i])
      plan.tunnels.back().approach = approach_of(*registered.bone_checks[i], state.stand_off_mm);
  }
  const std::string& bound = state.order ? state.order->name : state.bound_for;
  const auto tunnel = std::ranges::find(state.tunnels, bound, &operation::OperationTunnel::name);
  if (tunnel != state.tunnels.end() && tunnel->of_model &&
      tunnel->of_model->model == registered.registration.name)
    for (const Eigen::Vector3d& at : state.path.in_calibrator) plan.path.push_back(model_from_world * at);
  return plan;
}

}  // namespace

void MainWindow::remember(Folder kind, const fs::path& folder) {
  remember_folder(recent_, kind, folder);
  build_recent();
}

fs::path MainWindow::new_session() const {
  const QString now = QDateTime::currentDateTime().toString("yyyy-MM-dd_HH-mm-ss-zzz");
  return sessions_ / now.toStdString();
}

void MainWindow::ask_rehearsal(const RehearsalKind& kind) {
  leave_then([this, kind] { open_rehearsal(kind); });
}

void MainWindow::leave_then(std::function<void()> act) {
  const QString loss = controller_.loss();
  if (loss.isEmpty()) return act();
  auto* question =
      new QMessageBox(QMessageBox::Question, tr("Leave"), loss, QMessageBox::Yes | QMessageBox::No, this);
  question->setObjectName("leaveQuestion");
  question->setDefaultButton(QMessageBox::No);
  connect(question, &QDialog::finished, this, [act = std::move(act)](int answer) {
    if (answer == QMessageBox::Yes) act();
  });
  show_beside(question);
}

void MainWindow::leave_for(const std::vector<fs::path>& paths) {
  const bool has_own_window =
      paths.size() == 1 && (is_sequence(paths.front()) || is_run(paths.front()) || is_volume(paths.front()));
  if (has_own_window) return open_paths(paths);
  leave_then([this, paths] { open_paths(paths); });
}

void MainWindow::ask_new_case() {
  std::vector<pipeline::NewImage> images;
  const ApplicationState& state = controller_.state();
  if (state.source == Source::images)
    for (std::size_t i = 0; i < state.files.size(); ++i)
      images.push_back({state.files[i].file,
                        state.files[i].frames > 1 ? std::optional(panels_->frame_of(i)) : std::nullopt});
  offer_case(images);
}

void MainWindow::offer_case(const std::vector<pipeline::NewImage>& images) {
  if (!new_case_) {
    new_case_ = new NewCaseDialog(this);
    connect(new_case_, &NewCaseDialog::created, this,
            [this](const fs::path& folder) { leave_for({folder}); });
    connect(panels_, &XrayPanels::frame_changed, new_case_, [this](std::size_t view, int frame) {
      const ApplicationState& state = controller_.state();
      if (state.source == Source::images) new_case_->choose_frame(state.files.at(view).file, frame);
    });
  }
  new_case_->add_images(images);
  show_beside(new_case_);
  new_case_->raise();
}

void MainWindow::ask_folder() {
  ask_files(this, tr("Case or session"), QFileDialog::Directory, {},
            [this](const std::vector<fs::path>& chosen) { leave_for(chosen); });
}

void MainWindow::open_rehearsal(const RehearsalKind& kind) {
  virtual_devices::VirtualDevicesOptions virtual_or = settings_.virtual_or;
  virtual_or.tracker_port = virtual_or.rtde_port = virtual_or.dashboard_port = virtual_or.script_port = 0;
  virtual_or.freehand = kind.by_hand;
  const fs::path folder = new_session();
  controller_.open_virtual_or(virtual_or, settings_.plan, folder, kind.by_ct);
}

void MainWindow::open_plan(const fs::path& plan) {
  controller_.open_devices(plan, settings_.receiver, new_session());
}

void MainWindow::open_paths(const std::vector<fs::path>& paths) {
  const fs::path& first = paths.front();
  if (paths.size() == 1 && fs::is_regular_file(first)) {  // a file that stands for its folder, or a plan
    if (first.filename() == "case.json" || first.filename() == "session.log")
      return open_paths({fs::absolute(first).parent_path()});
    if (first.extension() == ".json") return open_plan(first);
    if (is_volume(first)) return void(open_ct(first, {}));
  }
  if (paths.size() == 1 && is_sequence(first)) return open_sequence(first);
  if (paths.size() == 1 && is_run(first)) return open_run(first);
  const bool is_folder = paths.size() == 1 && fs::is_directory(first);
  if (is_folder && fs::exists(first / "session.log")) return open_session(first);
  if (!is_folder) return open_images(paths);
  const std::vector<fs::path> loose =
      fs::exists(first / "case.json") ? std::vector<fs::path>{} : images_in(first);
  if (!loose.empty()) return open_images(loose, true);
  remember(Folder::cases, first);
  controller_.open_case(first);
}

void MainWindow::open_sequence(const fs::path& folder) {
  remember(Folder::cases, folder);
  auto* sequence = findChild<SequenceWindow*>("sequence");
  if (sequence == nullptr || sequence->is_busy()) sequence = new SequenceWindow(this);
  show_beside(sequence);
  sequence->open_case(folder, all_frames(folder));
}

void MainWindow::open_run(const fs::path& folder) {
  remember(Folder::cases, folder);
  auto* run = findChild<RunWindow*>("run");
  if (run == nullptr || run->is_busy()) run = new RunWindow(this);
  show_beside(run);
  run->open_case(folder);
}

BonesWindow* MainWindow::open_ct(const fs::path& file, CtPlan plan,
                                 const std::optional<pipeline::CaseModel>& model) {
  auto* bones = new BonesWindow(this);
  show_beside(bones);
  bones->open_ct(file, std::move(plan), model);
  return bones;
}

void MainWindow::open_ct_of(std::size_t model) {
  const ApplicationState& state = controller_.state();
  if (!state.registration || model >= state.models.size() || !state.models[model].volume) return;
  const pipeline::CaseModel& files = state.models[model];
  ct_of_model_ = {open_ct(*files.volume, plan_in_ct(state, model), files), state.folder, model};
}

void MainWindow::show_ct_plan() {
  const ApplicationState& state = controller_.state();
  const auto& [window, folder, model] = ct_of_model_;
  if (window) window->show_plan(folder == state.folder ? plan_in_ct(state, model) : CtPlan());
}

void MainWindow::open_images(const std::vector<fs::path>& files, bool offers_one) {
  controller_.open_images(files);
  if ((files.size() < 2 && !offers_one) || files.size() > most_loose_images) return;
  std::vector<pipeline::NewImage> images;
  for (const fs::path& file : files) images.push_back({file});
  offer_case(images);
}

void MainWindow::dragEnterEvent(QDragEnterEvent* event) {
  if (event->mimeData()->hasUrls()) event->acceptProposedAction();
}

void MainWindow::dropEvent(QDropEvent* event) {
  std::vector<fs::path> paths;
  for (const QUrl& url : event->mimeData()->urls())
    if (url.isLocalFile()) paths.push_back(url.toLocalFile().toStdString());
  if (!paths.empty()) leave_for(paths);
}

QString MainWindow::words_of_unsaved() const {
  const ApplicationState& state = controller_.state();
  const UnsavedChanges changes = unsaved_changes(state);
  const QString files = changes.files().join(", ");
  QStringList words{tr("Changes of %1:").arg(text(state.case_folder->string()))};
  if (changes.can_be_saved())
    words << tr("Not in case.json: %1. Not saved, they are kept beside it (%2) and restored when the case is "
                "opened again.")
                 .arg(changes.words(), files);
  words << changes.not_yet;
  if (!changes.can_be_saved()) words << tr("They are restored when the case is opened again.");
  if (!controller_.takes_picks())
    words << tr("Nothing is saved during other work (%1).").arg(text(state.doing));
  return words.join("\n\n");
}

/// Save is offered where something can be saved; what cannot is kept as without it.
void MainWindow::ask_of_unsaved_changes() {
  if (findChild<QMessageBox*>("unsavedQuestion") != nullptr) return;
  const bool can_save = controller_.takes_picks() && unsaved_changes(controller_.state()).can_be_saved();
  auto* question = new QMessageBox(QMessageBox::Question, tr("Changes that are not in case.json"),
                                   words_of_unsaved(), QMessageBox::Close | QMessageBox::Cancel, this);
  question->setObjectName("unsavedQuestion");
  question->button(QMessageBox::Close)->setText(tr("&Keep beside the case"));
  if (can_save) question->addButton(QMessageBox::Save);
  question->setDefaultButton(can_save ? QMessageBox::Save : QMessageBox::Close);
  connect(question, &QDialog::finished, this, [this](int answer) {
    if (answer == QMessageBox::Save) controller_.save_picks();
    const bool failed = answer == QMessageBox::Save && unsaved_changes(controller_.state()).can_be_saved();
    if (answer == QMessageBox::Cancel || failed) return;
    may_close_ = true;
    close();
  });
  show_beside(question);
}

void MainWindow::closeEvent(QCloseEvent* event) {
  const ApplicationState& state = controller_.state();
  if (!may_close_ && unsaved_changes(state).any() && !state.picks_not_kept) {
    event->ignore();
    return ask_of_unsaved_changes();
  }
  if (!may_close_ && !controller_.loss().isEmpty()) {
    event->ignore();
    return leave_then([this] {
      may_close_ = true;
      close();
    });
  }
  controller_.stop();
  QMainWindow::closeEvent(event);
}

}  // namespace helicarm::gui
