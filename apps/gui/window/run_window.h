// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QComboBox>
#include <QDialog>
#include <QLabel>
#include <QPushButton>
#include <QTableWidget>
#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "helicarm/core/failure.h"
#include "helicarm/sweep/sweep.h"

namespace helicarm::gui {

class CurvesView;
class FilmBar;
class XrayView;

/// A run of images of a calibrator, and its geometry once it is calibrated.
struct CalibratedRun {
  sweep::SweepCase given;
  std::optional<sweep::Sweep> sweep;
};

/// Whether case.json of this folder is of a run: a view with "frames".
bool is_run(const std::filesystem::path& folder);

/// A run of images: calibrates it, plays its images with their labels, lists which are accepted and why not,
/// and draws its path and flex.
class RunWindow : public QDialog {
  Q_OBJECT

 public:
  explicit RunWindow(QWidget* parent = nullptr);
  ~RunWindow() override;

  void open_case(const std::filesystem::path& folder);
  bool is_busy() const { return busy_ || reading_; }
  const std::shared_ptr<const CalibratedRun>& shown() const { return shown_; }
  /// Of the run's images, from 0.
  int frame() const;
  void set_frame(int number);
  /// Plays the run once and writes each image as displayed into the folder, image-00001.png and so on.
  void save_film(const std::filesystem::path& folder);

 private:
  using Done = Expected<std::shared_ptr<const CalibratedRun>>;

  QWidget* build_top();
  QWidget* build_images();
  QWidget* build_curves();
  void start(const QString& doing, std::function<Done()> work);
  void take(const Done& done);
  void calibrate();
  void show_nothing();
  bool can_write() const { return !busy_ && shown_ && shown_->sweep; }
  void allow();
  void read_frame();
  void show_frame(int number, const Expected<xray::XrayImage>& image);
  void end_frame();
  void fill_images();
  void show_curves();
  void ask_and_write();
  void ask_and_film();
  void film_frame(int number);

  std::shared_ptr<const CalibratedRun> shown_;
  std::shared_ptr<std::atomic<bool>> stopped_ = std::make_shared<std::atomic<bool>>(false);
  std::optional<std::filesystem::path> film_;  ///< folder of the images that are written as they are shown
  bool busy_ = false, reading_ = false;
  int displayed_ = -1;

  QPushButton *calibrate_ = nullptr, *cancel_ = nullptr, *write_ = nullptr, *save_film_ = nullptr;
  QLabel* says_ = nullptr;
  XrayView* view_ = nullptr;
  FilmBar* bar_ = nullptr;
  QTableWidget* images_ = nullptr;
  QComboBox* sheet_ = nullptr;
  CurvesView* curves_ = nullptr;
};

}  // namespace helicarm::gui
