// SPDX-License-Identifier: Apache-2.0
// The parts of the window of a sequence: controls, film, and its tables.
#include <QHBoxLayout>
#include <QShortcut>
#include <QTabWidget>
#include <QVBoxLayout>

#include "gui/replay/print_svg.h"
#include "gui/scene/scene_view.h"
#include "gui/window/curves_view.h"
#include "gui/window/film_bar.h"
#include "gui/window/list_table.h"
#include "gui/window/sequence_window.h"
#include "gui/xray/text.h"
#include "gui/xray/xray_view.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/track/body_pose.h"
#include "helicarm/track/track.h"

namespace helicarm::gui {
namespace {

QString words_of_marker(const track::TrackedMarker& marker) {
  switch (marker.status) {
    case track::MarkerStatus::lost:
      return SequenceWindow::tr("lost");
    case track::MarkerStatus::one_view:
      return SequenceWindow::tr("one view");
    case track::MarkerStatus::predicted:
      return SequenceWindow::tr("predicted");
    case track::MarkerStatus::tracked:
      break;
  }
  return marker.place ? SequenceWindow::tr("±%1 mm").arg(localization::length_at_95(marker.place->covariance),
                                                         0, 'f', 2)
                      : QString();
}

}  // namespace

SequenceWindow::SequenceWindow(QWidget* parent) : QDialog(parent) {
  setObjectName("sequence");
  setWindowFlag(Qt::WindowMaximizeButtonHint);
  auto* column = new QVBoxLayout(this);
  column->addWidget(build_top());
  says_ = new QLabel;
  says_->setObjectName("sequenceSays");
  says_->setWordWrap(true);
  column->addWidget(says_);
  column->addWidget(build_film(), 3);
  auto* tabs = new QTabWidget;
  tabs->setObjectName("sequenceTabs");
  tabs->addTab(build_tables(), tr("&Markers"));
  tabs->addTab(build_curves(), tr("&Curves"));
  tabs->addTab(build_scene(), tr("&Scene"));
  column->addWidget(tabs, 2);
  resize(1100, 740);
  allow();
}

QWidget* SequenceWindow::build_top() {
  auto* top = new QWidget;
  auto* row = new QHBoxLayout(top);
  row->setContentsMargins(0, 0, 0, 0);
  frames_ = new QLineEdit;
  frames_->setObjectName("sequenceFrames");
  frames_->setAccessibleName(tr("Frames, first-last or first-last:step"));
  frames_->setToolTip(frames_->accessibleName());
  row->addWidget(new QLabel(tr("Frames")));
  row->addWidget(frames_);
  const auto add = [&](const QString& words, const char* name, auto act) {
    auto* button = new QPushButton(words);
    button->setObjectName(name);
    button->setAutoDefault(false);
    row->addWidget(button);
    connect(button, &QPushButton::clicked, this, act);
    return button;
  };
  read_ = add(tr("&Read"), "sequenceRead", [this] { read(); });
  follow_ = add(tr("&Follow the markers"), "sequenceFollow", [this] { follow(); });
  undo_ = add(tr("&Undo the pick"), "sequenceUndo", [this] { undo_pick(); });
  connect(new QShortcut(QKeySequence::Undo, this), &QShortcut::activated, this, [this] { undo_pick(); });
  cancel_ = add(tr("&Cancel"), "sequenceCancel", [this] { *stopped_ = true; });
  write_ = add(tr("&Write tables and report..."), "sequenceWrite", [this] { ask_and_write(); });
  save_film_ = add(tr("&Save the film..."), "sequenceFilm", [this] { ask_and_film(); });
  save_film_->setToolTip(tr("Each frame as displayed, with its marks, as a PNG"));
  return top;
}

QWidget* SequenceWindow::build_film() {
  auto* whole = new QWidget;
  auto* column = new QVBoxLayout(whole);
  column->setContentsMargins(0, 0, 0, 0);
  film_frame_ = new QWidget;
  film_row_ = new QHBoxLayout(film_frame_);
  film_row_->setContentsMargins(0, 0, 0, 0);
  column->addWidget(film_frame_, 1);
  bar_ = new FilmBar("sequence");
  connect(bar_, &FilmBar::frame_wanted, this, &SequenceWindow::read_frame);
  column->addWidget(bar_);
  return whole;
}

QWidget* SequenceWindow::build_tables() {
  auto* whole = new QWidget;
  auto* row = new QHBoxLayout(whole);
  row->setContentsMargins(0, 0, 0, 0);
  markers_ = list_table("markerList", tr("Markers"));
  markers_->setColumnCount(6);
  markers_->setHorizontalHeaderLabels(
      {tr("Marker"), tr("Now"), tr("Tracked"), tr("One view"), tr("Predicted, lost"), tr("Worst ±95 %, mm")});
  by_frames_ = list_table("markersByFrames", tr("Markers by frames"));
  connect(by_frames_, &QTableWidget::cellClicked, this, [this](int frame, int) { set_frame(frame); });
  connect(by_frames_, &QTableWidget::cellActivated, this, [this](int frame, int) { set_frame(frame); });
  markers_->setSelectionBehavior(QAbstractItemView::SelectRows);
  markers_->setSelectionMode(QAbstractItemView::SingleSelection);
  markers_->setToolTip(tr("A click in an image places the selected marker there, in the displayed frame"));
  connect(markers_, &QTableWidget::itemSelectionChanged, this, &SequenceWindow::allow);
  row->addWidget(markers_, 1);
  row->addWidget(by_frames_, 1);
  return whole;
}

QWidget* SequenceWindow::build_curves() {
  auto* panel = new CurvesPanel("sequence", tr("Body, or body / reference"),
                                tr("Curves of the smooth motion with 95 % bars"));
  sheet_ = panel->sheet();
  curves_ = panel->curves();
  connect(sheet_, &QComboBox::currentIndexChanged, this, &SequenceWindow::show_curves);
  return panel;
}

QWidget* SequenceWindow::build_scene() {
  scene_ = new SceneView;
  scene_->setObjectName("sequenceScene");
  scene_->setAccessibleName(tr("Cameras, markers with their 95 % errors, and bodies in the displayed frame"));
  return scene_;
}

/// Of the displayed frame; the camera stays while the case is the same.
void SequenceWindow::show_scene() {
  if (!shown_ || !shown_->sequence || displayed_ < 0) return scene_->show_scene({}, Eigen::Vector3d::Zero());
  std::vector<Eigen::Vector3d> places;
  for (const track::TrackedMarker& marker : shown_->sequence->markers.front())
    if (marker.place) places.push_back(marker.place->place);
  scene_->show_scene(scene_of_frame(*shown_, std::size_t(displayed_)),
                     places.empty() ? Eigen::Vector3d::Zero() : Eigen::Vector3d(geometry::mean_of(places)),
                     has_scene_);
  if (!has_scene_) scene_->look_near();
  has_scene_ = true;
}

ResultScene scene_of_frame(const FollowedSequence& followed, std::size_t number) {
  constexpr double beyond = 1.5, rod_mm = 0.4;  // of the drawn images' depth
  const track::Sequence& sequence = *followed.sequence;
  ResultScene scene;
  std::vector<Eigen::Vector3d> places;
  for (std::size_t m = 0; m < followed.given.markers.size(); ++m)
    if (const auto& place = sequence.markers[number][m].place) {
      places.push_back(place->place);
      scene.points.push_back({followed.given.markers[m],
                              localization::PointSource::pick,
                              {},
                              ellipsoid_95(place->place, place->covariance),
                              {}});
    }
  const Eigen::Vector3d middle =
      places.empty() ? Eigen::Vector3d::Zero() : Eigen::Vector3d(geometry::mean_of(places));
  for (const track::TrackView& view : followed.given.views) {
    const Eigen::Vector2d size_px =
        view.image_size ? view.image_size->cast<double>() : Eigen::Vector2d(1024, 1024);
    scene.views.push_back(
        view_shape(view.images.name, view.camera, size_px, beyond * view.camera.depth(middle)));
  }
  for (std::size_t b = 0; b < sequence.bodies.size(); ++b) {
    const track::BodySequence& body = sequence.bodies[b];
    const auto& pose = body.smoothed[number].pose;
    if (!pose) continue;
    std::vector<Eigen::Vector3d> located;
    for (const track::PlacedMarker& marker : body.markers)
      if (marker.in_body) located.push_back(pose->pose * marker.in_body->place);
    for (std::size_t i = 0; i < located.size(); ++i)
      for (std::size_t k = i + 1; k < located.size(); ++k)
        scene.tunnels.push_back({i == 0 && k == 1 ? followed.given.bodies[b].name : std::string(),
                                 {},
                                 {located[i], located[k]},
                                 rod_mm});
  }
  return scene;
}

std::vector<report::Chart> marked_at(std::vector<report::Chart> charts, int frame) {
  for (report::Chart& chart : charts) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    const auto include = [&](double y) {
      if (std::isfinite(y)) low = std::min(low, y), high = std::max(high, y);
    };
    for (const report::ChartSeries& series : chart.series) {
      for (const auto& point : series.points) include(point[1]);
      for (const auto& range : series.ranges)
        for (const double y : range) include(y);
    }
    if (chart.y_range) low = chart.y_range->front(), high = chart.y_range->back();
    if (low <= high) {
      report::ChartSeries& line = chart.series.emplace_back();
      line.points = {{double(frame), low}, {double(frame), high}};
      line.dashed = true;
    }
  }
  return charts;
}

/// Those of the report.
void SequenceWindow::show_curves() {
  const auto sheets = shown_ && shown_->sequence ? track::curve_sheets(*shown_->sequence, shown_->given)
                                                 : std::vector<track::CurveSheet>();
  const int chosen = std::max(0, sheet_->currentIndex());
  const QSignalBlocker quiet(sheet_);
  sheet_->clear();
  for (const track::CurveSheet& sheet : sheets) sheet_->addItem(text(sheet.title));
  if (sheets.empty()) return curves_->show_svg({});
  const int at = std::min(chosen, int(sheets.size()) - 1);
  sheet_->setCurrentIndex(at);
  auto charts = sheets[std::size_t(at)].charts;
  if (displayed_ >= 0)
    charts = marked_at(std::move(charts), shown_->sequence->frames[std::size_t(displayed_)]);
  curves_->show_svg(chart_document(report::chart_svg(charts, charts.size())));
}

bool SequenceWindow::can_write() const {
  return !busy_ && shown_ && shown_->sequence && !shown_->sequence->failure && !shown_->is_corrected();
}

void SequenceWindow::allow() {
  read_->setEnabled(!busy_);
  follow_->setEnabled(!busy_ && shown_);
  cancel_->setEnabled(busy_);
  write_->setEnabled(can_write());
  undo_->setEnabled(!busy_ && corrections_.can_undo());
  for (XrayView* view : views_) view->set_picking(!busy_ && shown_ && markers_->currentRow() >= 0);
  save_film_->setEnabled(!busy_ && shown_ && !film_);
  bar_->setEnabled(shown_ != nullptr);
}

void SequenceWindow::show_views() {
  while (views_.size() > shown_->given.views.size()) {
    delete views_.back();
    views_.pop_back();
  }
  while (views_.size() < shown_->given.views.size()) {
    views_.push_back(new XrayView);
    views_.back()->set_layer(Layer::raw);
    connect(views_.back(), &XrayView::picked, this, [this, view = views_.size() - 1](const QPointF& raw) {
      pick(view, {raw.x(), raw.y()});
    });
    connect(views_.back(), &XrayView::shown, this, [this] {
      if (awaited_ > 0 && --awaited_ == 0) end_frame();
    });
    film_row_->addWidget(views_.back());
  }
}

void SequenceWindow::fill_tables() {
  const auto& markers = shown_->given.markers;
  const auto& sequence = shown_->sequence;
  markers_->setRowCount(int(markers.size()));
  const auto list = sequence ? marker_list(*sequence, markers) : std::vector<MarkerSummary>();
  for (int row = 0; row < markers_->rowCount(); ++row) {
    for (int column = 0; column < markers_->columnCount(); ++column)
      markers_->setItem(row, column, list_cell("–"));
    markers_->item(row, 0)->setText(text(markers[std::size_t(row)]));
    if (list.empty()) continue;
    const MarkerSummary& marker = list[std::size_t(row)];
    markers_->item(row, 2)->setText(QString::number(marker.frames[0]));
    markers_->item(row, 3)->setText(QString::number(marker.frames[1]));
    markers_->item(row, 4)->setText(QString("%1, %2").arg(marker.frames[2]).arg(marker.frames[3]));
    markers_->item(row, 5)->setText(marker.frames[0] > 0 ? fixed(marker.worst_95_mm, 2) : "–");
  }
  QStringList titles{tr("Frame")};
  for (const std::string& marker : markers) titles << text(marker);
  by_frames_->setColumnCount(int(titles.size()));
  by_frames_->setHorizontalHeaderLabels(titles);
  by_frames_->setRowCount(sequence ? int(sequence->frames.size()) : 0);
  for (int row = 0; row < by_frames_->rowCount(); ++row) {
    by_frames_->setItem(row, 0, list_cell(QString::number(sequence->frames[std::size_t(row)])));
    for (std::size_t m = 0; m < markers.size(); ++m) {
      const track::TrackedMarker& marker = sequence->markers[std::size_t(row)][m];
      by_frames_->setItem(row, int(m) + 1,
                          list_cell(words_of_marker(marker), marker.status != track::MarkerStatus::tracked));
    }
  }
}

/// The displayed frame's row, and each marker's state in it.
void SequenceWindow::mark_frame() {
  if (!shown_->sequence) return;
  by_frames_->setCurrentCell(displayed_, 0);
  for (int row = 0; row < markers_->rowCount(); ++row) {
    const track::TrackedMarker& now = shown_->sequence->markers[std::size_t(displayed_)][std::size_t(row)];
    markers_->setItem(row, 1, list_cell(words_of_marker(now), now.status != track::MarkerStatus::tracked));
  }
  show_curves();
  show_scene();
}

}  // namespace helicarm::gui
