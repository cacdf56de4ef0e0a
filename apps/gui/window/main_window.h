// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QLabel>
#include <QMainWindow>
#include <QSettings>
#include <QStackedWidget>
#include <filesystem>

#include "gui/controller/controller.h"
#include "gui/replay/recent.h"
#include "gui/replay/replay_panel.h"
#include "gui/replay/settings_dialog.h"
#include "gui/scene/scene_view.h"
#include "gui/window/live_bar.h"
#include "gui/window/pages.h"
#include "gui/window/step_strip.h"
#include "gui/xray/xray_view.h"

namespace helicarm::gui {

/// Steps, two X-ray images, the scene, the page of the step, and the live data; shows the controller's state.
class MainWindow : public QMainWindow {
  Q_OBJECT

 public:
  /// Sessions are stored below `sessions`.
  explicit MainWindow(std::filesystem::path sessions, QWidget* parent = nullptr);
  ~MainWindow() override;

  Controller& controller() { return controller_; }
  StepStrip& strip() { return *strip_; }
  XrayView& xray(std::size_t number) { return *xrays_.at(number); }
  SceneView& scene() { return *scene_; }
  LiveBar& live_bar() { return *live_bar_; }

  void open_rehearsal();
  void open_plan(const std::filesystem::path& plan);
  /// A case folder, a session's folder, or X-ray images.
  void open_paths(const std::vector<std::filesystem::path>& paths);
  /// Displays the devices' present state; called by a timer 50 times a second.
  void show_live();
  /// The displayed live data.
  const LiveState& live() const { return live_; }
  /// The tool at the replayed moment; empty if no case with a tool is replayed.
  const std::optional<operation::ToolOverlay>& recorded() const { return recorded_; }

 protected:
  void dragEnterEvent(QDragEnterEvent* event) override;
  void dropEvent(QDropEvent* event) override;
  bool eventFilter(QObject* watched, QEvent* event) override;
  void closeEvent(QCloseEvent* event) override;

 private:
  void build();
  void build_menus();
  void build_rehearsal_menu();
  QLayout* build_top();
  QWidget* build_right();
  void build_pages();
  void build_status();
  void build_replay();
  void build_recent();
  void open_session(const std::filesystem::path& session);
  std::filesystem::path new_session() const;
  void remember(Folder kind, const std::filesystem::path& folder);

  void show_state();
  void show_images();
  void show_picks();
  void show_phase(Phase phase);
  void place_pick(std::size_t view, const QPointF& raw);
  void move_pick(std::size_t view, const QString& name, const QPointF& raw);
  void show_tre();
  void show_moment(int index);
  void show_recorded();
  void ask_rehearsal();
  void ask_folder();
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
  std::array<XrayView*, 2> xrays_{};
  SceneView* scene_ = nullptr;
  LiveBar* live_bar_ = nullptr;
  QStackedWidget* pages_ = nullptr;
  std::vector<Page*> all_pages_;
  PlanPage* plan_ = nullptr;
  NavigatePage* navigate_ = nullptr;
  ReplayPanel* replay_ = nullptr;
  QDockWidget* replay_dock_ = nullptr;
  QAction* save_ = nullptr;
  QAction* undo_ = nullptr;
  QAction* redo_ = nullptr;
  QMenu* recent_menu_ = nullptr;
  QMenu* rehearsal_menu_ = nullptr;

  QWidget* busy_ = nullptr;  ///< progress and Cancel
  QLabel* recording_ = nullptr;

  LiveState live_;
  std::optional<TreCut> cut_;
  std::optional<localization::TreVolume> tre_;
  std::shared_ptr<const pipeline::Result> tre_of_;
  std::optional<operation::LiveTool> recorded_tool_;  ///< of the replayed session's case
  std::optional<std::size_t> recorded_at_;            ///< its registration
  std::shared_ptr<const pipeline::Result> recorded_of_;
  std::optional<operation::ToolOverlay> recorded_;  ///< at the replayed moment
  std::shared_ptr<const pipeline::Result> shown_;
  std::shared_ptr<const simulation::BoneMeshes> shown_bones_;
  Source shown_source_ = Source::none;
  Phase phase_ = Phase::acquire;
  unsigned looks_ = 0;
  bool moved_on_ = false;  ///< the user chose a step; it stays until the next success
};

}  // namespace helicarm::gui
