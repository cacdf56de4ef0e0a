// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QCheckBox>
#include <QComboBox>
#include <QDialog>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QTableWidget>
#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>

#include "gui/controller/corrections.h"
#include "gui/scene/scene_values.h"
#include "gui/xray/live_marks.h"
#include "helicarm/case_registration/follow_case.h"
#include "helicarm/core/failure.h"
#include "helicarm/report/chart.h"
#include "helicarm/track/sequence.h"
#include "helicarm/track/sequence_images.h"
#include "helicarm/track/track_case.h"

class QHBoxLayout;

namespace helicarm::gui {

class CurvesView;
class FilmBar;
class SceneView;
class XrayView;

/// A case of markers with its images, and what is known of the markers once they are followed.
struct FollowedSequence {
  std::filesystem::path folder;  ///< of the case
  track::TrackCase given;
  track::SequenceImages images;
  case_registration::FrameRange range;
  std::optional<track::Sequence> sequence;
  std::vector<track::MarkerPick> picks = {}, corrections = {};  ///< that `sequence` was followed from

  /// Whether picks were made since.
  bool is_corrected() const { return sequence && (picks != given.picks || corrections != given.corrections); }
};

/// A marker through a sequence: in how many frames it is tracked, and its worst 95 % error there, mm.
struct MarkerSummary {
  std::string name;
  std::array<int, 4> frames{};  ///< by `track::MarkerStatus`
  double worst_95_mm = 0;
};
std::vector<MarkerSummary> marker_list(const track::Sequence& sequence,
                                       const std::vector<std::string>& markers);

/// The charts with a line at a frame.
std::vector<report::Chart> marked_at(std::vector<report::Chart> charts, int frame);

/// The cameras, the markers with their 95 % errors, and the bodies at their smoothed poses, their markers
/// joined by rods, in one of the shown frames, from 0.
ResultScene scene_of_frame(const FollowedSequence& followed, std::size_t number);

/// Whether case.json of this folder is of a sequence of markers.
bool is_sequence(const std::filesystem::path& folder);
/// All frames of its first view, as A-B; empty if they are not known.
QString all_frames(const std::filesystem::path& folder);

/// A sequence of images with markers: follows them, plays the images with their marks, lists the markers
/// and their places by frames, and draws the bodies' curves and the bodies in space. The marker that is
/// selected in the list is picked by a click in an image, from whose frame it is then followed again.
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
  int frame() const;
  void set_frame(int number);
  /// Plays the sequence once and writes each frame as displayed into the folder, frame-00001.png and so on.
  void save_film(const std::filesystem::path& folder);
  /// The selected marker is at this raw pixel of the view in the displayed frame; kept in case.json at once.
  void pick(std::size_t view, const Eigen::Vector2d& raw);

 private:
  QWidget* build_top();
  QWidget* build_film();
  QWidget* build_tables();
  QWidget* build_curves();
  QWidget* build_scene();
  void show_scene();
  void show_curves();
  std::vector<track::MarkerPick> picks_of(int frame) const;
  void take_picks();
  void undo_pick();
  void read();
  void follow();
  void run(const QString& doing, std::function<Expected<std::shared_ptr<const FollowedSequence>>()> work);
  void take(const Expected<std::shared_ptr<const FollowedSequence>>& done);
  void allow();
  void show_views();
  void read_frame();
  void show_frame(int number, const Expected<std::vector<xray::XrayImage>>& images);
  void show_nothing();
  bool can_write() const;
  void fill_tables();
  void mark_frame();
  void ask_and_write();
  void ask_and_film();
  std::vector<FreshPick> marks_in(std::size_t view) const;
  void end_frame();
  void film_frame();

  std::filesystem::path folder_;
  std::shared_ptr<const FollowedSequence> shown_;
  std::shared_ptr<std::atomic<bool>> stopped_ = std::make_shared<std::atomic<bool>>(false);
  std::optional<std::filesystem::path> film_;  ///< folder of the frames that are written as they are shown
  bool busy_ = false, reading_ = false;
  bool has_scene_ = false;  ///< whose camera stays
  int displayed_ = -1;
  Corrections corrections_;

  QLineEdit* frames_ = nullptr;
  QPushButton *read_ = nullptr, *follow_ = nullptr, *cancel_ = nullptr, *write_ = nullptr,
              *save_film_ = nullptr, *undo_ = nullptr;
  QComboBox* sheet_ = nullptr;
  CurvesView* curves_ = nullptr;
  SceneView* scene_ = nullptr;
  QLabel* says_ = nullptr;
  QWidget* film_frame_ = nullptr;
  QHBoxLayout* film_row_ = nullptr;
  std::vector<XrayView*> views_;
  FilmBar* bar_ = nullptr;
  std::size_t awaited_ = 0;  ///< views that do not display the frame's image yet
  QTableWidget *markers_ = nullptr, *by_frames_ = nullptr;
};

}  // namespace helicarm::gui
