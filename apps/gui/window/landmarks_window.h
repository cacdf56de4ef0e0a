// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QDialog>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QTableWidget>
#include <QVBoxLayout>
#include <array>
#include <memory>
#include <optional>

#include "gui/controller/controller.h"
#include "gui/window/slice_view.h"
#include "gui/window/surface_view.h"

namespace helicarm::gui {

/// A case's model in slices and as a surface, in which a click places the landmarks that start its
/// registration. The controller keeps them; the window closes with its case.
class LandmarksWindow : public QDialog {
  Q_OBJECT

 public:
  LandmarksWindow(Controller& controller, std::size_t model, QWidget* parent = nullptr);

  bool is_busy() const { return busy_; }
  const CtScene& slices() const { return slices_scene_; }
  const SurfaceScene& surface() const { return surface_scene_; }
  /// In the coordinates of the model, mm; nothing before the first click.
  const std::optional<Eigen::Vector3d>& cursor() const { return surface_scene_.cursor; }

 private:
  /// What its files hold.
  struct Loaded {
    std::shared_ptr<const volume::Volume> ct;
    CtBody body = {};
    std::shared_ptr<const phantom::TriangleMesh> mesh;
    std::vector<Eigen::Vector3d> proposals;
    QStringList told;
  };
  static Loaded loaded(const pipeline::CaseModel& model);

  QWidget* build_views(bool has_volume);
  QWidget* build_side();
  void build_buttons(QVBoxLayout* column);
  void load();
  void take(const Loaded& loaded);
  void place(const Eigen::Vector3d& in_model);
  void add();
  void move_to_cursor();
  void rename();
  void remove();
  void propose();
  std::optional<std::string> chosen() const;
  const std::vector<pipeline::PointInModel>& landmarks() const;
  void show_state();
  void show_places();
  void fill_table();
  void say_next();
  void allow();

  Controller& controller_;
  std::size_t model_;
  pipeline::CaseModel files_;
  std::filesystem::path folder_;  ///< of the case
  std::vector<Eigen::Vector3d> proposals_;
  QStringList told_;  ///< of the files
  CtScene slices_scene_;
  SurfaceScene surface_scene_;
  bool busy_ = false;

  std::array<SliceView*, 3> slices_{};
  SurfaceView* surface_ = nullptr;
  QLabel *says_ = nullptr, *at_ = nullptr;
  QLineEdit* name_ = nullptr;
  QPushButton *add_ = nullptr, *move_ = nullptr, *rename_ = nullptr, *remove_ = nullptr, *propose_ = nullptr;
  QTableWidget* table_ = nullptr;
};

}  // namespace helicarm::gui
