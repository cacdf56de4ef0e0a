// SPDX-License-Identifier: Apache-2.0
#include "gui/window/main_window.h"

#include <QApplication>
#include <QDockWidget>
#include <QHBoxLayout>
#include <QKeyEvent>
#include <QMenu>
#include <QPushButton>
#include <QScrollArea>
#include <QSplitter>
#include <QStatusBar>
#include <QVBoxLayout>
#include <algorithm>

#include "gui/controller/stale.h"
#include "gui/controller/steps.h"
#include "gui/controller/unsaved_changes.h"
#include "gui/window/ask_files.h"
#include "gui/window/landmarks_window.h"
#include "gui/window/points_panel.h"
#include "gui/window/register_page.h"
#include "gui/window/style.h"
#include "gui/window/work_bar.h"
#include "gui/xray/text.h"

namespace helicarm::gui {
namespace {

constexpr int live_ms = 20;
constexpr int reason_stays_ms = 5000;

/// The first step that is not done; the plan is the last one of a case of files.
Phase open_phase(const std::array<StepCard, phases.size()>& cards, const ApplicationState& state) {
  if (state.source == Source::images) return Phase::acquire;
  const bool registered = state.hand_eye_rms_mm.has_value() || state.drill;
  if (state.is_guided) return Phase::navigate;
  if (state.is_replayed && state.drill && !state.outcomes.empty()) return Phase::verify;
  if (can_register(state) && (!state.registration || awaits_confirmation(state))) return Phase::registration;
  for (const StepCard& card : cards) {
    if (card.phase == Phase::registration) continue;  // a step that may be left out
    if (card.phase == Phase::navigate && state.source == Source::files && !registered) return Phase::plan;
    if (card.status == StepStatus::good || (card.status == StepStatus::warning && card.phase != Phase::plan))
      continue;
    // A plan with warnings is inspected before any motion.
    if (card.status != StepStatus::warning || !registered) return card.phase;
  }
  return Phase::verify;
}

}  // namespace

MainWindow::MainWindow(std::filesystem::path sessions, QWidget* parent)
    : QMainWindow(parent), sessions_(std::move(sessions)) {
  setWindowTitle(tr("helicarm"));
  setAcceptDrops(true);
  settings_ = kept_settings(recent_);
  controller_.set_options({settings_.run, settings_.search});
  focus_ = new FocusKeeper(this);
  build();
  build_menus();
  connect(&controller_, &Controller::changed, this, &MainWindow::show_state);
  connect(&controller_, &Controller::refused, this, [this](Phase phase, const QString& why) {
    moved_on_ = false;
    show_phase(phase);
    log(why);
    show_reason(why);
  });
  connect(&controller_, &Controller::models_stepped, this, [this] {
    moved_on_ = true;
    show_phase(Phase::registration);
  });
  connect(&controller_, &Controller::exported, this, &MainWindow::tell_of_the_export);
  connect(&controller_, &Controller::told, this, &MainWindow::tell);
  connect(&timer_, &QTimer::timeout, this, &MainWindow::show_live);
  timer_.start(live_ms);
  panels_->show_state(controller_.state());
  qApp->installEventFilter(this);
  show_state();
}

MainWindow::~MainWindow() { qApp->removeEventFilter(this); }

void MainWindow::build() {
  auto* middle = new QWidget;
  auto* column = new QVBoxLayout(middle);
  column->setContentsMargins(6, 6, 6, 6);
  column->setSpacing(6);
  column->addLayout(build_top());
  auto* sides = new QSplitter(Qt::Horizontal);
  sides->setObjectName("sides");
  panels_ = new XrayPanels;
  for (std::size_t i = 0; i < xrays_.size(); ++i) {
    xrays_[i] = &panels_->xray(i);
    connect(xrays_[i], &XrayView::not_picked, this, &MainWindow::tell_why_not_picked);
  }
  sides->addWidget(panels_);
  sides->setStretchFactor(0, 6);
  connect(panels_, &XrayPanels::picked, this, &MainWindow::place_pick);
  connect(panels_, &XrayPanels::pick_moved, this, &MainWindow::move_pick);
  connect(panels_, &XrayPanels::pick_menu_wanted, this, &MainWindow::ask_of_pick);
  connect(panels_, &XrayPanels::displayed, this, [this] {
    show_picks();
    show_measures();
    show_outlines();
    show_handles();
  });
  sides->addWidget(build_right());
  sides->setStretchFactor(1, 3);
  sides->setSizes({2000, 1000});  // a third for the scene and the page
  column->addWidget(sides, 1);
  live_bar_ = new LiveBar;
  column->addWidget(live_bar_);
  setCentralWidget(middle);
  build_status();
  build_replay();
  build_measures();
  build_log();
  build_panels();
  build_tour();
  build_handles();
}

QLayout* MainWindow::build_top() {
  auto* top = new QHBoxLayout;
  strip_ = new StepStrip;
  top->addWidget(strip_, 1);
  auto* stop = new QPushButton(tr("STOP"));
  stop->setObjectName("stop");
  stop->setProperty("class", "stop");
  stop->setToolTip(tr("Stops the robot at once (space bar)"));
  stop->setFocusPolicy(Qt::NoFocus);
  connect(stop, &QPushButton::pressed, &controller_, &Controller::stop);
  top->addWidget(stop);
  connect(strip_, &StepStrip::chosen, this, [this](Phase phase) {
    moved_on_ = true;
    show_phase(phase);
  });
  return top;
}

QWidget* MainWindow::build_right() {
  auto* right = new QSplitter(Qt::Vertical);
  right->setObjectName("right");
  scene_ = new SceneView;
  scene_->setObjectName("scene");
  right->addWidget(scene_);
  build_pages();
  right->addWidget(pages_);
  right->setSizes({280, 380});
  right->setStretchFactor(0, 1);
  right->setStretchFactor(1, 2);
  right_ = right;
  fit_text();
  return right;
}

void MainWindow::build_pages() {
  pages_ = new QStackedWidget;
  pages_->setObjectName("pages");
  auto* acquire = new AcquirePage(controller_, this);
  auto* rectify = new RectifyPage(controller_, this);
  plan_ = new PlanPage(controller_, this);
  navigate_ = new NavigatePage(controller_, this);
  auto* verify = new VerifyPage(controller_, this);
  register_ = new RegisterPage(controller_, this);
  for (Page* page : std::initializer_list<Page*>{acquire, rectify, new CalibratePage(controller_, this),
                                                 plan_, navigate_, verify, register_}) {
    auto* scrolled = new QScrollArea;
    scrolled->setWidgetResizable(true);
    scrolled->setFrameShape(QFrame::NoFrame);
    scrolled->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
    scrolled->setWidget(page);
    scrolled->setFocusPolicy(Qt::NoFocus);
    pages_->addWidget(scrolled);
    all_pages_.push_back(page);
  }
  connect(acquire, &AcquirePage::rehearsal_wanted, this, [this] { open_rehearsal({}); });
  connect(acquire, &AcquirePage::tour_wanted, this, &MainWindow::ask_tour);
  connect(acquire, &AcquirePage::folder_wanted, this, &MainWindow::ask_folder);
  connect(acquire, &AcquirePage::new_case_wanted, this, &MainWindow::ask_new_case);
  connect(rectify, &RectifyPage::layer_wanted, panels_, &XrayPanels::set_layer);
  connect(register_, &RegisterPage::slices_wanted, this, &MainWindow::open_ct_of);
  connect(register_, &RegisterPage::landmarks_wanted, this, [this](std::size_t model) {
    if (model < controller_.state().models.size()) show_beside(new LandmarksWindow(controller_, model, this));
  });
  connect(register_, &RegisterPage::held_changed, this, &MainWindow::show_handles);
  connect(plan_, &PlanPage::target_changed, this, &MainWindow::show_picks);
  connect(plan_, &PlanPage::map_wanted, this, [this](const std::optional<TreCut>& cut) {
    cut_ = cut;
    show_tre();
  });
  connect(verify, &VerifyPage::report_wanted, this, &MainWindow::ask_and_export);
}

void MainWindow::build_status() {
  told_ = new QLabel;
  told_->setObjectName("told");
  told_->setMinimumWidth(1);  // the window may be narrower than the sentence
  statusBar()->addWidget(told_, 1);
  recording_ = new QLabel(tr("● recording"));
  recording_->setProperty("class", "recording");
  statusBar()->addPermanentWidget(recording_);
  busy_ = new QWidget;
  auto* row = new QHBoxLayout(busy_);
  row->setContentsMargins(0, 0, 0, 0);
  work_ = new WorkBar;
  work_->setFixedSize(120, 18);
  row->addWidget(work_);
  auto* cancel = new QPushButton(tr("Ca&ncel"));
  cancel->setObjectName("cancel");
  cancel->setStyleSheet("padding: 1px 12px;");
  connect(cancel, &QPushButton::clicked, &controller_, &Controller::cancel);
  row->addWidget(cancel);
  statusBar()->addPermanentWidget(busy_);
}

void MainWindow::show_state() {
  ApplicationState state = displayed_state();
  log_steps(std::exchange(cards_, steps_of(state)));
  show_steps();
  refresh_present();
  if (!state.busy && !moved_on_) show_phase(open_phase(cards_, state));
  if (state.busy)  // its page stays; so does the plan's, where a registration's landmarks are picked
    moved_on_ = state.busy == Phase::registration || (state.has_models && state.busy == Phase::navigate) ||
                (state.has_models && state.busy == Phase::calibrate && phase_ == Phase::plan);
  state.result = present_;
  for (std::size_t i = 0; i < all_pages_.size(); ++i) {
    all_pages_[i]->show_state(state);
    all_pages_[i]->show_card(cards_[i], state);
  }
  setWindowTitle(state.folder.empty() ? tr("helicarm") : tr("helicarm: %1").arg(text(state.folder.string())));
  rehearsal_menu_->setEnabled(state.source == Source::virtual_or);
  if (auto* cable = findChild<QAction*>("cut_cable")) cable->setVisible(!state.drill);
  busy_->setVisible(state.busy.has_value());
  const bool replays = state.source == Source::files && replay_dock_->isVisible();
  recording_->setText(replays ? tr("▶ replay") : tr("● recording"));
  recording_->setVisible(replays || state.source == Source::virtual_or || state.source == Source::devices);
  recording_->setToolTip(tr("Every step is recorded in %1").arg(text(state.folder.string())));
  show_work(state);
  save_->setEnabled(unsaved_changes(state).any());
  show_edits();
  show_images();
  show_picks();
  show_outlines();
  show_models();
  show_handles();
  show_ct_plan();
  points_->show_state(state);
  focus_->restore(pages_->currentWidget());
}

/// In the status line.
void MainWindow::show_work(const ApplicationState& state) {
  work_->show_work(state.busy ? std::optional(state.doing) : std::nullopt);
  if (!reason_stays_.hasExpired()) return;
  if (state.busy) return statusBar()->showMessage(text(state.doing));
  const auto stands = [&](const auto& refusal) {
    return sentence_of(refusal.second) == statusBar()->currentMessage();
  };
  if (std::ranges::none_of(state.refusals, stands)) statusBar()->clearMessage();
}

void MainWindow::show_edits() {
  const QString undoes = controller_.undoes(), redoes = controller_.redoes();
  undo_->setEnabled(controller_.can_undo());
  redo_->setEnabled(controller_.can_redo());
  undo_->setText(undoes.isEmpty() ? tr("&Undo") : tr("&Undo: %1").arg(undoes));
  redo_->setText(redoes.isEmpty() ? tr("&Redo") : tr("&Redo: %1").arg(redoes));
}

void MainWindow::refresh_present() {
  const ApplicationState& state = controller_.state();
  const QString why = state.result ? stale(state, Phase::calibrate) : QString();
  std::set<std::string> points;
  if (state.result)
    for (const pipeline::PointResult& point : state.result->points)
      if (point.source == localization::PointSource::pick && is_stale(state, point.name))
        points.insert(point.name);
  if (present_of_ == state.result && why == out_of_date_ && points == stale_points_) return;
  present_of_ = state.result;
  out_of_date_ = why;
  stale_points_ = std::move(points);
  present_ = present_result(state);
}

void MainWindow::show_images() {
  ApplicationState state = controller_.state();
  state.result = out_of_date_.isEmpty() ? state.result : present_;
  const bool are_new = shown_ != state.result || shown_source_ != state.source;
  if (are_new) {
    shown_ = state.result;
    shown_source_ = state.source;
    show_recorded();  // only over the images of its own case
    panels_->show_state(state);
    if (std::exchange(shown_bones_, state.bones) != state.bones)
      scene_->show_bones(state.bones ? std::optional(*state.bones) : std::nullopt);
  }
  panels_->set_out_of_date(out_of_date_, stale_points_);
  if (!are_new && in_scene_ == present_) return;
  in_scene_ = present_;
  scene_->set_notice(out_of_date_.isEmpty() ? QString() : tr("out of date"));
  scene_->show_result(state.measured && out_of_date_.isEmpty() ? present_ : nullptr, state.calibrator,
                      !are_new);
  show_measures();
  if (are_new && state.measured && scene_->preset() == SceneView::Preset::free) scene_->look_near();
  show_tre();
}

void MainWindow::show_phase(Phase phase) {
  phase_ = phase;
  strip_->choose(phase);
  pages_->setCurrentIndex(int(phase));
  show_picks();
  show_handles();
}

void MainWindow::show_steps() { strip_->show_steps(with_devices(cards_, displayed_state(), live_)); }

void MainWindow::tell(const QString& words) {
  log(words);
  statusBar()->clearMessage();
  told_->setText(words);
  told_->setToolTip(words);
  if (controller_.state().busy) show_reason(words);
}

void MainWindow::show_reason(const QString& why) {
  const bool is_busy = controller_.state().busy.has_value();
  if (is_busy) reason_stays_.setRemainingTime(reason_stays_ms);
  statusBar()->showMessage(why, is_busy ? reason_stays_ms : 0);
}

void MainWindow::tell_of_the_export() {
  const ExportRecord& done = *controller_.state().exported;
  const QString folder = text(done.folder.string());
  tell(done.lacks.isEmpty()
           ? tr("Exported to %1 at %2.").arg(folder, done.at)
           : tr("Exported to %1 at %2, without: %3.").arg(folder, done.at, done.lacks.join("; ")));
  moved_on_ = true;  // the page says the same
  show_phase(Phase::verify);
}

bool MainWindow::eventFilter(QObject* watched, QEvent* event) {
  if (event->type() == QEvent::KeyPress || event->type() == QEvent::ShortcutOverride) {
    const auto* key = static_cast<QKeyEvent*>(event);
    const Source source = controller_.state().source;
    // The space bar is reserved for stopping the robot; Enter presses buttons instead.
    if (key->key() == Qt::Key_Space && (source == Source::virtual_or || source == Source::devices)) {
      if (event->type() == QEvent::KeyPress && !key->isAutoRepeat()) controller_.stop();
      event->accept();
      return true;
    }
    auto* button = qobject_cast<QAbstractButton*>(watched);
    const bool enter = key->key() == Qt::Key_Return || key->key() == Qt::Key_Enter;
    if (enter && event->type() == QEvent::KeyPress && button && !qobject_cast<HoldButton*>(button)) {
      button->click();
      return true;
    }
  }
  return QMainWindow::eventFilter(watched, event);
}

}  // namespace helicarm::gui
