// SPDX-License-Identifier: Apache-2.0
#include "gui/window/run_window.h"

#include <QApplication>
#include <QHBoxLayout>
#include <QPointer>
#include <QTabWidget>
#include <QThreadPool>
#include <QVBoxLayout>
#include <algorithm>
#include <utility>

#include "gui/controller/steps.h"
#include "gui/replay/print_svg.h"
#include "gui/window/ask_files.h"
#include "gui/window/curves_view.h"
#include "gui/window/film_bar.h"
#include "gui/window/list_table.h"
#include "gui/xray/text.h"
#include "gui/xray/xray_view.h"
#include "helicarm/core/json.h"
#include "helicarm/report/chart.h"
#include "helicarm/sweep/estimate_frame.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

constexpr auto no_value = "–";

QStringList row_of(const sweep::SweepFrame& frame) {
  QStringList row{text(frame.view)};
  if (frame.failure)
    row << RunWindow::tr("refused");
  else
    row << (frame.decision == sweep::Decision::warn ? RunWindow::tr("doubtful") : RunWindow::tr("accepted"));
  row << QString::number(frame.fiducials_used)
      << (frame.best ? fixed(frame.best->reprojection_rms_px, 3) : no_value)
      << (frame.best && frame.off_path_sigma ? fixed(*frame.off_path_sigma, 1) : no_value)
      << (frame.failure ? text(code(frame.failure->reason)) : QString());
  return row;
}

QString words_of(const sweep::Sweep& sweep) {
  const auto accepted =
      std::ranges::count_if(sweep.frames, [](const auto& frame) { return frame.best.has_value(); });
  QStringList words{RunWindow::tr("%1 of %2 images accepted.").arg(accepted).arg(sweep.frames.size())};
  if (sweep.path && sweep.path->source_to_detector_mm)
    words[0] += RunWindow::tr(" Arc %1 degrees, source to axis %2 mm, to detector %3 mm.")
                    .arg(fixed(sweep.path->arc_deg, 1), fixed(sweep.path->source_to_axis_mm, 1),
                         fixed(*sweep.path->source_to_detector_mm, 1));
  else if (sweep.path)
    words[0] += RunWindow::tr(" Arc %1 degrees, source to axis %2 mm.")
                    .arg(fixed(sweep.path->arc_deg, 1), fixed(sweep.path->source_to_axis_mm, 1));
  if (sweep.failure) words << sentence_of(*sweep.failure);
  for (const Warning& warning : sweep.warnings) words << sentence_of(warning);
  return words.join('\n');
}

}  // namespace

bool is_run(const fs::path& folder) {
  const auto json = read_json(folder / "case.json");
  if (!json || !json->is_object() || !json->contains("views") || json->contains("markers")) return false;
  const Json& views = json->at("views");
  return views.is_array() && std::ranges::any_of(views, [](const Json& view) {
           return view.is_object() && view.contains("frames");
         });
}

RunWindow::RunWindow(QWidget* parent) : QDialog(parent) {
  setObjectName("run");
  setWindowFlag(Qt::WindowMaximizeButtonHint);
  auto* column = new QVBoxLayout(this);
  column->addWidget(build_top());
  says_ = new QLabel;
  says_->setObjectName("runSays");
  says_->setWordWrap(true);
  column->addWidget(says_);
  view_ = new XrayView;
  view_->set_layer(Layer::raw);
  column->addWidget(view_, 3);
  connect(view_, &XrayView::shown, this, &RunWindow::end_frame);
  bar_ = new FilmBar("run");
  connect(bar_, &FilmBar::frame_wanted, this, &RunWindow::read_frame);
  column->addWidget(bar_);
  auto* tabs = new QTabWidget;
  tabs->setObjectName("runTabs");
  tabs->addTab(build_images(), tr("&Images"));
  tabs->addTab(build_curves(), tr("&Curves"));
  column->addWidget(tabs, 2);
  resize(1000, 860);
  allow();
}

RunWindow::~RunWindow() { *stopped_ = true; }

QWidget* RunWindow::build_top() {
  auto* top = new QWidget;
  auto* row = new QHBoxLayout(top);
  row->setContentsMargins(0, 0, 0, 0);
  const auto add = [&](const QString& words, const char* name, auto act) {
    auto* button = new QPushButton(words);
    button->setObjectName(name);
    button->setAutoDefault(false);
    row->addWidget(button);
    connect(button, &QPushButton::clicked, this, act);
    return button;
  };
  calibrate_ = add(tr("Calibrate the &run"), "runCalibrate", [this] { calibrate(); });
  cancel_ = add(tr("Ca&ncel"), "runCancel", [this] { *stopped_ = true; });
  write_ = add(tr("&Write geometry and report..."), "runWrite", [this] { ask_and_write(); });
  save_film_ = add(tr("&Save the film..."), "runFilm", [this] { ask_and_film(); });
  save_film_->setToolTip(tr("Each image as displayed, with its labels, as a PNG"));
  row->addStretch(1);
  return top;
}

QWidget* RunWindow::build_images() {
  images_ = list_table("runImages", tr("Images of the run"));
  images_->setSelectionBehavior(QAbstractItemView::SelectRows);
  images_->horizontalHeader()->setStretchLastSection(true);
  images_->setColumnCount(6);
  images_->setHorizontalHeaderLabels({tr("Image"), tr("Decision"), tr("Fiducials"), tr("Residual, px"),
                                      tr("Off the path, σ"), tr("Reason")});
  connect(images_, &QTableWidget::cellClicked, this, [this](int row, int) { set_frame(row); });
  connect(images_, &QTableWidget::cellActivated, this, [this](int row, int) { set_frame(row); });
  return images_;
}

QWidget* RunWindow::build_curves() {
  auto* panel = new CurvesPanel("run", tr("Curves by angle or by image"), tr("Curves of the run's path"));
  sheet_ = panel->sheet();
  curves_ = panel->curves();
  sheet_->addItems({tr("Path and flex, by angle"), tr("Residuals and errors, by image")});
  connect(sheet_, &QComboBox::currentIndexChanged, this, &RunWindow::show_curves);
  return panel;
}

int RunWindow::frame() const { return bar_->frame(); }

void RunWindow::set_frame(int number) { bar_->set_frame(number); }

void RunWindow::open_case(const fs::path& folder) {
  if (busy_) return;
  show_nothing();
  setWindowTitle(tr("Run: %1").arg(text(folder.string())));
  start(tr("The case is read."), [folder]() -> Done {
    auto given = sweep::read_sweep_case(folder);
    if (!given) return tl::unexpected(given.error());
    return std::make_shared<const CalibratedRun>(CalibratedRun{*std::move(given), {}});
  });
}

/// Nothing of a run stays under the name of another one.
void RunWindow::show_nothing() {
  shown_.reset();
  film_.reset();
  displayed_ = -1;
  bar_->stop();
  if (view_->is_computing()) end_frame();
  view_->clear({});
  images_->setRowCount(0);
  show_curves();
}

void RunWindow::start(const QString& doing, std::function<Done()> work) {
  if (busy_) return;
  busy_ = true;
  *stopped_ = false;
  says_->setText(doing);
  allow();
  QThreadPool::globalInstance()->start([self = QPointer<RunWindow>(this), work = std::move(work)] {
    const Done done = work();
    QMetaObject::invokeMethod(
        qApp,
        [self, done] {
          if (self) self->take(done);
        },
        Qt::QueuedConnection);
  });
}

void RunWindow::take(const Done& done) {
  busy_ = false;
  allow();
  if (!done) return says_->setText(sentence_of(done.error()));
  shown_ = *done;
  says_->setText(shown_->sweep ? words_of(*shown_->sweep)
                               : tr("%1 images; not calibrated yet.").arg(shown_->given.frames.size()));
  bar_->set_count(int(shown_->given.frames.size()));
  displayed_ = -1;
  fill_images();
  show_curves();
  allow();
  read_frame();
}

void RunWindow::calibrate() {
  if (!shown_) return;
  const auto tell = [self = QPointer<RunWindow>(this)](double share) {
    QMetaObject::invokeMethod(
        qApp,
        [self, share] {
          if (self && self->busy_) self->says_->setText(tr("%1 %").arg(std::lround(100 * share)));
        },
        Qt::QueuedConnection);
  };
  start(tr("The images are calibrated."), [from = shown_, stopped = stopped_, tell]() -> Done {
    auto sweep = sweep::run_sweep(from->given, {}, [&](double share) {
      if (*stopped) throw BadInput(Reason::interrupted, "cancelled");
      tell(share);
    });
    if (!sweep) return tl::unexpected(sweep.error());
    return std::make_shared<const CalibratedRun>(CalibratedRun{from->given, *std::move(sweep)});
  });
}

void RunWindow::allow() {
  calibrate_->setEnabled(!busy_ && shown_);
  cancel_->setEnabled(busy_);
  write_->setEnabled(can_write());
  save_film_->setEnabled(!busy_ && shown_ && !film_);
  bar_->setEnabled(shown_ != nullptr);
}

void RunWindow::read_frame() {
  if (!shown_ || reading_ || displayed_ == frame()) return;
  reading_ = true;
  bar_->set_waiting(true);
  QThreadPool::globalInstance()->start([self = QPointer<RunWindow>(this), of = shown_, number = frame()] {
    auto image = std::make_shared<Expected<xray::XrayImage>>(
        sweep::rectified_image_of(of->given.frames[std::size_t(number)], of->given));
    QMetaObject::invokeMethod(
        qApp,
        [self, of, number, image] {
          if (!self) return;
          if (self->shown_ == of) self->show_frame(number, *image);
          if (self->shown_ != of || !*image) self->end_frame();
        },
        Qt::QueuedConnection);
  });
}

void RunWindow::show_frame(int number, const Expected<xray::XrayImage>& image) {
  displayed_ = number;
  const sweep::Frame& frame = shown_->given.frames[std::size_t(number)];
  bar_->set_name(text(frame.view.name));
  if (images_->rowCount() > number) images_->setCurrentCell(number, 0);
  if (!image) {
    view_->clear(sentence_of(image.error()));
  } else {
    auto result = std::make_shared<pipeline::Result>();
    pipeline::ViewResult& view = result->views.emplace_back();
    view.name = frame.view.name;
    view.xray_image = std::make_shared<const xray::XrayImage>(*image);
    if (shown_->sweep) {
      const sweep::SweepFrame& found = shown_->sweep->frames[std::size_t(number)];
      view.calibrated = found.best ? found.best : found.alone;
      if (!found.fiducials.empty()) view.found.emplace().fiducials = found.fiducials;
      result->failure = found.failure;
    }
    view_->set_given_pixels(sweep::has_distortion(frame, shown_->given) ? tr("rectified") : QString());
    view_->show_view(result, 0, true);
  }
}

void RunWindow::end_frame() {
  if (!std::exchange(reading_, false)) return;
  bar_->set_waiting(false);
  if (film_ && displayed_ >= 0) film_frame(displayed_);
  read_frame();  // another one is wanted meanwhile
}

void RunWindow::fill_images() {
  const auto& frames = shown_->given.frames;
  images_->setRowCount(int(frames.size()));
  for (int row = 0; row < images_->rowCount(); ++row) {
    const auto* found = shown_->sweep ? &shown_->sweep->frames[std::size_t(row)] : nullptr;
    QStringList words = found ? row_of(*found) : QStringList{text(frames[std::size_t(row)].view.name)};
    words.resize(images_->columnCount());
    for (int column = 0; column < images_->columnCount(); ++column) {
      auto* cell = list_cell(words[column], found && found->failure);
      if (found && found->failure) cell->setToolTip(sentence_of(*found->failure));
      images_->setItem(row, column, cell);
    }
  }
}

/// Those of the report.
void RunWindow::show_curves() {
  const bool by_angle = sheet_->currentIndex() == 0;
  const auto charts = !shown_ || !shown_->sweep ? std::vector<report::Chart>()
                      : by_angle                ? sweep::path_charts(*shown_->sweep)
                                                : sweep::image_charts(*shown_->sweep);
  curves_->show_svg(charts.empty() ? QByteArray() : chart_document(report::chart_svg(charts, charts.size())));
}

void RunWindow::ask_and_write() {
  ask_files(this, tr("Folder for the geometry and the report"), QFileDialog::Directory, {},
            [this](const std::vector<fs::path>& chosen) {
              if (!can_write()) return says_->setText(tr("There is nothing to be written now."));
              const auto written = sweep::write_sweep(*shown_->sweep, chosen.front());
              says_->setText(written ? tr("Written to %1.").arg(text(chosen.front().string()))
                                     : sentence_of(written.error()));
            });
}

void RunWindow::ask_and_film() {
  ask_files(this, tr("Folder for the images of the film"), QFileDialog::Directory, {},
            [this](const std::vector<fs::path>& chosen) { save_film(chosen.front()); });
}

void RunWindow::save_film(const fs::path& folder) {
  if (!shown_ || film_) return;
  film_ = folder;
  displayed_ = -1;
  set_frame(0);
  allow();
  read_frame();
}

void RunWindow::film_frame(int number) {
  const QString name = QString("image-%1.png").arg(number + 1, 5, 10, QChar('0'));
  QImage film(view_->size(), QImage::Format_RGB32);
  view_->render(&film);
  if (!film.save(QString::fromStdString((*film_ / name.toStdString()).string()))) {
    says_->setText(tr("%1 cannot be written.").arg(name));
    film_.reset();
  } else if (bar_->is_last()) {
    says_->setText(tr("The film's images are in %1.").arg(text(film_->string())));
    film_.reset();
  } else {
    set_frame(number + 1);
  }
  allow();
}

}  // namespace helicarm::gui
