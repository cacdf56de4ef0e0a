// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QDeadlineTimer>
#include <QLabel>
#include <QMainWindow>
#include <QPlainTextEdit>
#include <QPointer>
#include <QSettings>
#include <QSplitter>
#include <QStackedWidget>
#include <filesystem>
#include <set>

#include "gui/controller/controller.h"
#include "gui/replay/kept_settings.h"
#include "gui/replay/recent.h"
#include "gui/replay/replay_panel.h"
#include "gui/replay/settings_dialog.h"
#include "gui/scene/scene_view.h"
#include "gui/window/focus_keeper.h"
#include "gui/window/live_bar.h"
#include "gui/window/new_case_dialog.h"
#include "gui/window/pages.h"
#include "gui/window/step_strip.h"
#include "gui/window/xray_panels.h"
#include "gui/xray/measures_panel.h"

namespace helicarm::gui {

class PointsPanel;
class RegisterPage;
class BonesWindow;
struct CtPlan;
class Tour;
class WorkBar;
struct TourStep;

/// Steps, two X-ray images, the scene, the page of the step, and the live data; shows the controller's state.
class MainWindow : public QMainWindow {
  Q_OBJECT

 public:
  /// Sessions are stored below `sessions`.
  explicit MainWindow(std::filesystem::path sessions, QWidget* parent = nullptr);
  ~MainWindow() override;

  Controller& controller() { return controller_; }
  StepStrip& strip() { return *strip_; }
  XrayPanels& xrays() { return *panels_; }
  XrayView& xray(std::size_t panel) { return *xrays_.at(panel); }
  NewCaseDialog* new_case() { return new_case_; }
  SceneView& scene() { return *scene_; }
  LiveBar& live_bar() { return *live_bar_; }

  struct RehearsalKind {
    bool by_ct = false;    ///< its tunnels are planned in a CT
    bool by_hand = false;  ///< a virtual person holds the drill; there is no robot
  };
  void open_rehearsal(const RehearsalKind& kind);
  /// Makes and opens a simulated case, and walks through the window with it.
  void start_tour();
  void open_plan(const std::filesystem::path& plan);
  /// A case folder, a session's folder, or X-ray images: these are shown, and two or more are offered as a
  /// new case.
  void open_paths(const std::vector<std::filesystem::path>& paths);
  /// Displays the devices' present state; called by a timer 50 times a second.
  void show_live();
  /// Size, place and parts of the window, for the next start.
  void keep_layout();
  void restore_layout();
  /// The displayed live data.
  const LiveState& live() const { return live_; }
  /// The tool at the replayed moment; empty if no case with a tool is replayed.
  const std::optional<operation::ToolOverlay>& recorded() const { return recorded_; }

 protected:
  void dragEnterEvent(QDragEnterEvent* event) override;
  void dropEvent(QDropEvent* event) override;
  bool eventFilter(QObject* watched, QEvent* event) override;
  void closeEvent(QCloseEvent* event) override;
  void changeEvent(QEvent* event) override;

 private:
  void build();
  void build_menus();
  void build_rehearsal_menu();
  QLayout* build_top();
  QWidget* build_right();
  void build_pages();
  void build_status();
  void build_replay();
  void build_measures();
  void build_measure_menu();
  /// Room for the widest button at the present text size.
  void fit_text();
  void build_layers_menu(QMenu* view);
  void build_scene_menu(QMenu* view);
  void build_appearance_menu(QMenu* view);
  /// The table, X-ray image or scene that has the focus to the clipboard, else the window.
  void copy();
  void build_recent();
  /// A case of markers through a sequence, in a window of its own.
  void open_sequence(const std::filesystem::path& folder);
  /// A run of images of a calibrator, in a window of its own.
  void open_run(const std::filesystem::path& folder);
  /// Slices of a CT, to find its bones, in a window of its own.
  BonesWindow* open_ct(const std::filesystem::path& file, CtPlan plan,
                       const std::optional<pipeline::CaseModel>& model = {});
  void open_ct_of(std::size_t model);
  void show_ct_plan();
  void open_session(const std::filesystem::path& session);
  std::filesystem::path new_session() const;
  void remember(Folder kind, const std::filesystem::path& folder);

  /// The controller's, with the recorded steps at a replayed moment.
  ApplicationState displayed_state() const;
  void refresh_present();
  void show_work(const ApplicationState& state);
  void show_edits();
  void show_state();
  void show_images();
  void show_picks();
  void show_measures();
  /// Of the registered models, over each X-ray image.
  void show_outlines();
  /// The registered models in the scene.
  void show_models();
  void display_wanted(const std::optional<WantedPick>& wanted);
  void show_picks_in(std::size_t panel, std::size_t view, const std::optional<WantedPick>& wanted);
  using EpipolarLine = std::vector<Eigen::Vector2d>;  ///< rectified px
  std::vector<EpipolarLine> epipolar_lines_of(const std::string& point,
                                              const pipeline::ViewResult& view) const;
  void show_phase(Phase phase);
  void place_pick(std::size_t view, const QPointF& raw);
  void move_pick(std::size_t view, const QString& name, const QPointF& raw);
  void ask_of_pick(std::size_t view, const QString& name, const QPoint& at);
  void show_steps();
  void build_log();
  void build_panels();
  /// Out of the column at the right, to float on another screen or be docked.
  void build_scene_apart(QMenu* view);
  void build_tour();
  void ask_tour();
  std::vector<TourStep> tour_steps();
  void build_handles();
  /// At the bottom, hidden; to be docked elsewhere or to float.
  QDockWidget* add_panel(const QString& title, const char* name, QWidget* content);
  struct HeldModel {
    std::size_t model;
    registration::RigidStep step;  ///< from its registered pose
    Eigen::Vector3d centre;        ///< at the displayed pose
  };
  std::optional<HeldModel> held_model() const;
  void show_handles();
  /// By a drag between raw pixels.
  void drag_model(std::size_t panel, HandlePart part, const QPointF& from, const QPointF& to, bool continues);
  /// The robot comes into the scene's view as soon as it is registered, the path when it is planned.
  void look_at_the_robot(const LiveScene& scene);
  /// A line of the log, with the time.
  void log(const QString& words);
  void log_steps(const StepCards& before);
  /// Stands in the status line until something else is to be told.
  void tell(const QString& words);
  /// In the status line; during other work for some seconds, before its steps are told again.
  void show_reason(const QString& why);
  /// Where a point is asked for that is not picked during other work.
  void tell_why_not_picked();
  void tell_of_the_export();
  QString words_of_unsaved() const;
  void ask_of_unsaved_changes();
  void show_tre();
  void show_moment();
  void show_recorded();
  void add_moment(LiveState& live) const;
  /// Acts at once, or after a question if something would be lost.
  void leave_then(std::function<void()> act);
  void leave_for(const std::vector<std::filesystem::path>& paths);
  /// `offers_one`: as a new case also a single image.
  void open_images(const std::vector<std::filesystem::path>& files, bool offers_one = false);
  void ask_rehearsal(const RehearsalKind& kind);
  void ask_folder();
  void ask_new_case();
  void offer_case(const std::vector<pipeline::NewImage>& images);
  void ask_and_export();
  void save_screenshot();
  void ask_settings();
  void say(const Failure& failure);

  std::filesystem::path sessions_;
  QSettings recent_;
  Settings settings_;
  Controller controller_;
  QTimer timer_;

  StepStrip* strip_ = nullptr;
  XrayPanels* panels_ = nullptr;
  std::array<XrayView*, XrayPanels::most_large> xrays_{};  ///< those of the panels
  SceneView* scene_ = nullptr;
  LiveBar* live_bar_ = nullptr;
  QSplitter* right_ = nullptr;
  QStackedWidget* pages_ = nullptr;
  std::vector<Page*> all_pages_;
  PlanPage* plan_ = nullptr;
  RegisterPage* register_ = nullptr;
  PointsPanel* points_ = nullptr;
  Tour* tour_ = nullptr;
  std::vector<QDockWidget*> docks_;  ///< panels that `build_panels` has made
  NavigatePage* navigate_ = nullptr;
  ReplayPanel* replay_ = nullptr;
  QDockWidget* replay_dock_ = nullptr;
  QAction* save_ = nullptr;
  QAction* undo_ = nullptr;
  QAction* redo_ = nullptr;
  MarkGroups mark_groups_ = all_marks;
  FocusKeeper* focus_ = nullptr;
  MeasureTool measure_tool_;
  MeasuresPanel* measures_ = nullptr;
  QDockWidget* measures_dock_ = nullptr;
  QAction* leave_tool_ = nullptr;
  std::shared_ptr<const pipeline::Result> measures_of_;
  std::vector<std::shared_ptr<const pipeline::Result>> measures_of_frames_;
  QMenu* recent_menu_ = nullptr;
  QPlainTextEdit* log_ = nullptr;
  QDockWidget* log_dock_ = nullptr;
  QMenu* rehearsal_menu_ = nullptr;
  struct {
    QPointer<BonesWindow> window;
    std::filesystem::path folder;  ///< of the case or session
    std::size_t model = 0;
  } ct_of_model_;  ///< opened last

  QPointer<NewCaseDialog> new_case_;
  bool may_close_ = false;
  std::string wanted_view_;  ///< of the next pick
  QWidget* busy_ = nullptr;  ///< progress and Cancel
  WorkBar* work_ = nullptr;
  QLabel* recording_ = nullptr;
  QLabel* told_ = nullptr;
  QDeadlineTimer reason_stays_;  ///< of `show_reason`: the work's steps do not replace it
  StepCards cards_;              ///< without the devices

  LiveState live_;
  std::optional<TreCut> cut_;
  std::optional<localization::TreVolume> tre_;
  std::shared_ptr<const pipeline::Result> tre_of_;
  std::optional<operation::LiveTool> recorded_tool_;  ///< of the replayed session's case
  std::optional<std::size_t> recorded_at_;            ///< its registration
  std::shared_ptr<const pipeline::Result> recorded_of_;
  std::optional<operation::ToolOverlay> recorded_;                           ///< at the replayed moment
  std::vector<StatusIndicator> recorded_markers_;                            ///< likewise
  std::shared_ptr<const pipeline::Result> shown_;                            ///< of the images
  std::shared_ptr<const pipeline::Result> present_, present_of_, in_scene_;  ///< `present_result`
  QString out_of_date_;                                                      ///< why the whole measurement is
  std::set<std::string> stale_points_;
  std::shared_ptr<const simulation::BoneMeshes> shown_bones_;
  std::shared_ptr<const case_registration::CaseRegistration> shown_registration_;
  std::optional<std::pair<std::size_t, Eigen::Matrix4d>> shown_nudge_;  ///< model and pose
  QString shown_stale_models_;
  Source shown_source_ = Source::none;
  Phase phase_ = Phase::acquire;
  unsigned looks_ = 0;
  enum class RobotView { unknown, whole, path } robot_view_ = RobotView::unknown;
  bool moved_on_ = false;  ///< the user chose a step; it stays until the next success
};

}  // namespace helicarm::gui
