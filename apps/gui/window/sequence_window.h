// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QCheckBox>
#include <QDialog>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QSlider>
#include <QTableWidget>
#include <QTimer>
#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>

#include "helicarm/case_registration/follow_case.h"
#include "helicarm/core/failure.h"
#include "helicarm/track/sequence.h"
#include "helicarm/track/sequence_images.h"
#include "helicarm/track/track_case.h"

class QHBoxLayout;

namespace helicarm::gui {

class XrayView;

/// A case of markers with its images, and what is known of the markers once they are followed.
struct FollowedSequence {
  track::TrackCase given;
  track::SequenceImages images;
  case_registration::FrameRange range;
  std::optional<track::Sequence> sequence;
};

/// A marker through a sequence: in how many frames it is tracked, and its worst 95 % error there, mm.
struct MarkerSummary {
  std::string name;
  std::array<int, 4> frames{};  ///< by `track::MarkerStatus`
  double worst_95_mm = 0;
};
std::vector<MarkerSummary> marker_list(const track::Sequence& sequence,
                                       const std::vector<std::string>& markers);

/// Whether case.json of this folder is of a sequence of markers.
bool is_sequence(const std::filesystem::path& folder);
/// All frames of its first view, as A-B; empty if they are not known.
QString all_frames(const std::filesystem::path& folder);

/// A sequence of images with markers: follows them, plays the images with their marks, and lists the markers
/// and their places by frames.
class SequenceWindow : public QDialog {
  Q_OBJECT

 public:
  explicit SequenceWindow(QWidget* parent = nullptr);
  ~SequenceWindow() override;

  /// A case whose case.json has "markers". `frames` as A-B or A-B:STEP.
  void open_case(const std::filesystem::path& folder, const QString& frames);
  bool is_busy() const { return busy_ || reading_; }
  const std::shared_ptr<const FollowedSequence>& shown() const { return shown_; }
  /// Of the shown frames, from 0.
  int frame() const { return slider_->value(); }
  void set_frame(int number) { slider_->setValue(number); }

 private:
  QWidget* build_top();
  QWidget* build_film();
  QWidget* build_tables();
  void read();
  void follow();
  void run(const QString& doing, std::function<Expected<std::shared_ptr<const FollowedSequence>>()> work);
  void take(const Expected<std::shared_ptr<const FollowedSequence>>& done);
  void allow();
  void show_views();
  void read_frame();
  void show_frame(int number, const Expected<std::vector<xray::XrayImage>>& images);
  void fill_tables();
  void mark_frame();
  void ask_and_write();
  void ask_and_film();
  void play_on();

  std::filesystem::path folder_;
  std::shared_ptr<const FollowedSequence> shown_;
  std::shared_ptr<std::atomic<bool>> stopped_ = std::make_shared<std::atomic<bool>>(false);
  std::optional<std::filesystem::path> film_;  ///< folder of the frames that are written as they are shown
  bool busy_ = false, reading_ = false;
  int displayed_ = -1;

  QLineEdit* frames_ = nullptr;
  QPushButton *read_ = nullptr, *follow_ = nullptr, *cancel_ = nullptr, *write_ = nullptr,
              *save_film_ = nullptr, *play_ = nullptr;
  QLabel *says_ = nullptr, *number_ = nullptr;
  QWidget* film_frame_ = nullptr;
  QHBoxLayout* film_row_ = nullptr;
  std::vector<XrayView*> views_;
  QSlider* slider_ = nullptr;
  QTableWidget *markers_ = nullptr, *by_frames_ = nullptr;
  QTimer clock_;
};

}  // namespace helicarm::gui
