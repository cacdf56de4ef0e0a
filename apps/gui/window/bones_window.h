// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QDialog>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QTableWidget>
#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>

#include "gui/window/slice_view.h"
#include "helicarm/pipeline/case_model.h"
#include "helicarm/segmentation/segment_files.h"

namespace helicarm::gui {

/// Whether the name is that of a volume's file.
bool is_volume(const std::filesystem::path& file);

/// Slices of a CT in three directions, with planned tunnels. A seed clicked in each bone finds the bones,
/// whose masks and surfaces can be written.
class BonesWindow : public QDialog {
  Q_OBJECT

 public:
  explicit BonesWindow(QWidget* parent = nullptr);
  ~BonesWindow() override;

  /// `model`: of which it is the CT; its body is outlined.
  void open_ct(const std::filesystem::path& file, CtPlan plan = {},
               const std::optional<pipeline::CaseModel>& model = {});
  /// Instead of the earlier one.
  void show_plan(CtPlan plan);
  bool is_busy() const { return busy_; }
  const CtScene& scene() const { return scene_; }
  const std::vector<segmentation::Seed>& seeds() const { return seeds_; }
  const std::shared_ptr<const segmentation::SegmentAnswer>& found() const { return found_; }

 private:
  QWidget* build_side();
  void run(const QString& doing, std::function<std::function<void()>()> work);
  void place(const Eigen::Vector3d& voxel);
  void add_seed();
  void remove_seed();
  void find_bones();
  void show_bones(const Expected<std::shared_ptr<const segmentation::SegmentAnswer>>& done);
  void ask_and_write();
  void seeds_changed();
  void show_scene();
  void fill_table();
  void allow();
  double value_at(const Eigen::Vector3d& voxel) const;

  std::filesystem::path file_;
  CtPlan plan_;
  CtScene scene_;
  std::vector<segmentation::Seed> seeds_;
  std::shared_ptr<const segmentation::SegmentAnswer> found_;  ///< of the present seeds
  std::shared_ptr<std::atomic<bool>> stopped_ = std::make_shared<std::atomic<bool>>(false);
  bool busy_ = false;

  std::array<SliceView*, 3> slices_{};
  QLabel *says_ = nullptr, *at_ = nullptr;
  QLineEdit* name_ = nullptr;
  QDoubleSpinBox* threshold_ = nullptr;
  QPushButton *add_ = nullptr, *remove_ = nullptr, *find_ = nullptr, *cancel_ = nullptr, *write_ = nullptr;
  QTableWidget* table_ = nullptr;
};

}  // namespace helicarm::gui
