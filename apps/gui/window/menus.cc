// SPDX-License-Identifier: Apache-2.0
#include <QApplication>
#include <QDockWidget>
#include <QMenuBar>
#include <QMessageBox>
#include <QStatusBar>
#include <QThreadPool>

#include "gui/controller/steps.h"
#include "gui/window/ask_files.h"
#include "gui/window/bones_window.h"
#include "gui/window/main_window.h"
#include "helicarm/core/program_version.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

constexpr double tre_step_mm = 10;

QString path_text(const fs::path& path) { return QString::fromStdString(path.string()); }

}  // namespace

void MainWindow::build_menus() {
  QMenu* file = menuBar()->addMenu(tr("&File"));
  file->addAction(tr("&New rehearsal with virtual devices"), QKeySequence::New, this,
                  [this] { ask_rehearsal({}); });
  QMenu* rehearsals = file->addMenu(tr("New &rehearsal of another kind"));
  rehearsals->addAction(tr("&Tunnels planned in a CT"), this, [this] { ask_rehearsal({.by_ct = true}); });
  rehearsals->addAction(tr("&Drill held by hand"), this, [this] { ask_rehearsal({.by_hand = true}); });
  rehearsals->addAction(tr("Tunnels planned in a &CT, drill held by hand"), this,
                        [this] { ask_rehearsal({.by_ct = true, .by_hand = true}); });
  file->addAction(tr("&Connect the devices of a plan..."), this, [this] {
    ask_files(this, tr("Plan"), QFileDialog::ExistingFile, tr("Plan (*.json)"),
              [this](const std::vector<fs::path>& chosen) {
                leave_then([this, plan = chosen.front()] { open_plan(plan); });
              });
  });
  file->addAction(tr("New &case of X-ray images..."), QKeySequence(tr("Ctrl+Shift+N")), this,
                  &MainWindow::ask_new_case);
  file->addAction(tr("&Open a case or session folder..."), QKeySequence::Open, this, &MainWindow::ask_folder);
  file->addAction(tr("Open &X-ray images..."), this, [this] {
    ask_files(this, tr("X-rays"), QFileDialog::ExistingFiles, {},
              [this](const std::vector<fs::path>& chosen) { leave_for(chosen); });
  });
  file->addAction(tr("Slices and &bones of a CT..."), this, [this] {
    ask_files(this, tr("CT"), QFileDialog::ExistingFile, {},
              [this](const std::vector<fs::path>& chosen) { open_ct(chosen.front(), {}); });
  });
  recent_menu_ = file->addMenu(tr("&Recent"));
  build_recent();
  file->addSeparator();
  save_ = file->addAction(tr("&Save picks and landmarks in the case"), QKeySequence::Save, &controller_,
                          &Controller::save_picks);
  file->addAction(tr("&Export report and results..."), QKeySequence(tr("Ctrl+E")), this,
                  &MainWindow::ask_and_export);
  file->addAction(tr("Save &screenshot..."), QKeySequence(tr("Ctrl+P")), this, &MainWindow::save_screenshot);
  file->addAction(tr("Se&ttings..."), QKeySequence(tr("Ctrl+,")), this, &MainWindow::ask_settings);
  file->addSeparator();
  file->addAction(tr("&Quit"), QKeySequence(tr("Ctrl+Q")), this, &QWidget::close);

  QMenu* edit = menuBar()->addMenu(tr("&Edit"));
  undo_ = edit->addAction(tr("&Undo"), QKeySequence::Undo, &controller_, &Controller::undo);
  redo_ = edit->addAction(tr("&Redo"), QKeySequence::Redo, &controller_, &Controller::redo);
  edit->addAction(tr("&Measure again"), QKeySequence(Qt::Key_F5), &controller_, &Controller::measure_again);
  edit->addSeparator();
  edit->addAction(tr("&Copy image or table"), QKeySequence::Copy, this, &MainWindow::copy);

  QMenu* view = menuBar()->addMenu(tr("&View"));
  using Preset = SceneView::Preset;
  for (const auto& [words, preset, key] : {std::tuple(tr("Scene as in the &AP view"), Preset::ap, "Ctrl+1"),
                                           {tr("Scene as in the &lateral view"), Preset::lateral, "Ctrl+2"},
                                           {tr("Scene from &outside"), Preset::free, "Ctrl+3"}})
    view->addAction(words, QKeySequence(key), this, [this, wanted = preset] { scene_->set_preset(wanted); });
  view->addAction(tr("Scene &near at the knee"), QKeySequence("Ctrl+4"), scene_, &SceneView::look_near);
  view->addAction(replay_dock_->toggleViewAction());
  view->addAction(measures_dock_->toggleViewAction());
  view->addAction(log_dock_->toggleViewAction());
  for (const QDockWidget* dock : docks_)
    if (dock->features() & QDockWidget::DockWidgetClosable) view->addAction(dock->toggleViewAction());
  build_scene_apart(view);
  build_layers_menu(view);
  build_scene_menu(view);
  build_appearance_menu(view);
  build_measure_menu();
  QAction* four = view->addAction(tr("&Four large X-ray images"));
  four->setObjectName("fourImages");
  four->setShortcut(QKeySequence("Ctrl+5"));
  four->setCheckable(true);
  connect(four, &QAction::toggled, this, [this](bool on) {
    recent_.setValue("view/four_images", on);
    panels_->set_large(on ? XrayPanels::most_large : 2);
  });
  four->setChecked(recent_.value("view/four_images").toBool());
  build_rehearsal_menu();

  QMenu* help = menuBar()->addMenu(tr("&Help"));
  const auto notify = [this](const QString& title, const QString& words) {
    auto* box = new QMessageBox(QMessageBox::Information, title, words, QMessageBox::Close, this);
    box->setObjectName(title.toLower());
    show_beside(box);
  };
  help->addAction(tr("&Keys"), QKeySequence::HelpContents, this, [notify] {
    notify(
        tr("Keys"),
        tr("Space: stop the robot\nAlt+1 to Alt+7: steps\nTab: next control\n"
           "Enter: press; hold it on a yellow button\n"
           "Ctrl+N rehearsal, Ctrl+Shift+N case of X-ray images, Ctrl+O open, Ctrl+5 two or four images, "
           "Ctrl+E export, Ctrl+C copy, Ctrl+P screenshot, Ctrl+, settings\n"
           "F5 measures again, Ctrl+S saves picks and landmarks, Ctrl+Z undoes a change, Ctrl+Shift+Z "
           "repeats it, "
           "Delete "
           "removes the end "
           "chosen in the table\n\n"
           "On an X-ray image: + - 0 zoom, arrows pan, Shift+arrows and Enter place a tunnel's end, dragging "
           "moves a placed end, L layer, M magnifier, W contrast, H marks\n\n"
           "In 3-D: 1 AP, 2 lateral, 3 outside, 4 near, arrows turn, + - zoom, R resets\n\n"
           "Replay: J and L step, K plays"));
  });
  help->addAction(tr("&Tour"), this, &MainWindow::ask_tour);
  help->addAction(tr("&About"), this, [notify] {
    notify(tr("About helicarm"), tr("helicarm %1\nResearch instrument, not a medical device.")
                                     .arg(QString::fromStdString(program_version())));
  });
}

void MainWindow::build_rehearsal_menu() {
  rehearsal_menu_ = menuBar()->addMenu(tr("Rehears&al"));
  for (const auto& [words, fault] : {std::pair(tr("Hide the &tool's marker"), "hide:tool"),
                                     {tr("Hide the &femur's marker"), "hide:femur"},
                                     {tr("Hide the t&ibia's marker"), "hide:tibia"},
                                     {tr("Tracker repeats its last pose (f&rozen)"), "frozen"},
                                     {tr("Tracker stops &sending"), "silent"},
                                     {tr("Tracker's &clock jumps"), "time_jump"},
                                     {tr("&Robot's cable is disconnected"), "cut_cable"},
                                     {tr("C-arm disconnects &before the image"), "breaks_off"},
                                     {tr("C-arm sends another &patient's image"), "other_patient"}}) {
    QAction* action = rehearsal_menu_->addAction(words);
    action->setCheckable(true);
    action->setObjectName(fault);
    connect(action, &QAction::toggled, this,
            [this, name = std::string(fault)](bool on) { controller_.set_fault(name, on); });
  }
  rehearsal_menu_->addSeparator();
  rehearsal_menu_->addAction(tr("&Move the leg by a few millimetres"), this, [this] {
    controller_.move_bone("femur", {2, -1.5, 1});
    controller_.move_bone("tibia", {-1, 2, 1.5});
  });
}

void MainWindow::build_recent() {
  recent_menu_->clear();
  for (const Folder kind : {Folder::cases, Folder::sessions})
    for (const fs::path& folder : recent_folders(recent_, kind))
      recent_menu_->addAction(path_text(folder), this, [this, folder] { leave_for({folder}); });
  recent_menu_->setEnabled(!recent_menu_->isEmpty());
}

void MainWindow::ask_and_export() {
  if (controller_.state().busy) return controller_.export_to({});  // says that it waits
  auto* dialog = new QFileDialog(this, tr("Folder for the report and the results"));
  dialog->setObjectName("exportDialog");
  dialog->setFileMode(QFileDialog::AnyFile);  // a new folder is made
  dialog->setAcceptMode(QFileDialog::AcceptSave);
  dialog->setOption(QFileDialog::DontConfirmOverwrite);
  dialog->setLabelText(QFileDialog::FileName, tr("Folder (a new one is made):"));
  dialog->selectFile("helicarm-export");
  connect(dialog, &QFileDialog::fileSelected, this,
          [this](const QString& name) { controller_.export_to(name.toStdString()); });
  show_beside(dialog);
}

void MainWindow::save_screenshot() {
  auto* dialog = new QFileDialog(this, tr("Screenshot"), "helicarm.png", tr("PNG (*.png)"));
  dialog->setAcceptMode(QFileDialog::AcceptSave);
  connect(dialog, &QFileDialog::fileSelected, this, [this, image = grab().toImage()](const QString& name) {
    if (!image.save(name)) say({Reason::cannot_write, name.toStdString() + ": cannot write"});
  });
  show_beside(dialog);
}

void MainWindow::ask_settings() {
  auto* dialog = new SettingsDialog(settings_, this);
  connect(dialog, &QDialog::accepted, this, [this, dialog] {
    settings_ = dialog->settings();
    keep_settings(recent_, settings_);
    controller_.set_options({settings_.run, settings_.search});
    const ApplicationState& state = controller_.state();
    tell(state.source == Source::files && !state.is_replayed
             ? tr("The case is measured with these settings; those of devices apply to the next rehearsal or "
                  "connection.")
             : tr("Measurement settings apply to the next case; the others to the next rehearsal or "
                  "connection."));
  });
  show_beside(dialog);
}

void MainWindow::show_tre() {
  const Eigen::Vector3d middle = phantom::middle_of(controller_.state().calibrator);
  if (!cut_ || !shown_ || !controller_.state().measured || !out_of_date_.isEmpty())
    return scene_->show_tre({}, SliceAxis::z, 0);
  if (tre_of_ == shown_)
    return scene_->show_tre(tre_, cut_->axis, middle[int(cut_->axis)] + cut_->from_middle_mm);
  scene_->show_tre({}, SliceAxis::z, 0);
  calibration::Calibration calibration{{}, pipeline::joint_covariance(*shown_)};
  for (const pipeline::ViewResult& view : shown_->views)
    if (view.calibrated) calibration.views.push_back(*view.calibrated);
  QPointer<MainWindow> self(this);
  QThreadPool::globalInstance()->start([self, calibration, middle, of = shown_] {
    auto volume = localization::predict_tre(calibration, middle, tre_half_mm, tre_step_mm,
                                            fiducials::click_sigma_px, 1);
    QMetaObject::invokeMethod(
        qApp,
        [self, volume = std::move(volume), of] {
          if (!self || self->shown_ != of) return;
          self->tre_ = volume;
          self->tre_of_ = of;
          self->show_tre();
        },
        Qt::QueuedConnection);
  });
}

void MainWindow::say(const Failure& failure) {
  log(sentence_of(failure));
  statusBar()->showMessage(sentence_of(failure));
}

}  // namespace helicarm::gui
