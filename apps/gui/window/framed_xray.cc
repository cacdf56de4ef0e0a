// SPDX-License-Identifier: Apache-2.0
#include "gui/window/framed_xray.h"

#include <QApplication>
#include <QHBoxLayout>
#include <QPointer>
#include <QSignalBlocker>
#include <QThreadPool>
#include <QVBoxLayout>

#include "helicarm/xray/read_xray_image.h"

namespace helicarm::gui {
namespace {

constexpr int play_ms = 120;

/// One frame as a result without detections; null if it cannot be read.
std::shared_ptr<const pipeline::Result> frame_alone(const ViewFile& file, int frame,
                                                    const std::string& view) {
  auto read = xray::read_xray_image(file.file, view, frame);
  if (!read) return nullptr;
  auto result = std::make_shared<pipeline::Result>();
  result->views.resize(1);
  result->views.front().name = view;
  result->views.front().xray_image = std::make_shared<const xray::XrayImage>(*std::move(read));
  return result;
}

}  // namespace

FramedXray::FramedXray(QWidget* parent) : QWidget(parent), xray_(new XrayView), bar_(build_bar()) {
  auto* column = new QVBoxLayout(this);
  column->setContentsMargins(0, 0, 0, 0);
  column->setSpacing(2);
  column->addWidget(xray_, 1);
  column->addWidget(bar_);
  bar_->hide();
  connect(slider_, &QSlider::valueChanged, this, [this](int frame) {
    if (!result_) return;
    show_frame(frame, true);
    emit frame_changed(view_, frame);
  });
  connect(play_, &QPushButton::toggled, this, [this](bool plays) {
    play_->setText(plays ? tr("Halt") : tr("Play"));
    plays ? clock_.start(play_ms) : clock_.stop();
  });
  connect(&clock_, &QTimer::timeout, this, &FramedXray::play_on);
}

QWidget* FramedXray::build_bar() {
  auto* bar = new QWidget;
  auto* row = new QHBoxLayout(bar);
  row->setContentsMargins(0, 0, 0, 0);
  play_ = new QPushButton(tr("Play"));
  play_->setObjectName("playFrames");
  play_->setCheckable(true);
  play_->setStyleSheet("padding: 2px 8px;");
  slider_ = new QSlider(Qt::Horizontal);
  slider_->setObjectName("frame");
  slider_->setAccessibleName(tr("Frame"));
  slider_->setPageStep(1);
  number_ = new QLabel;
  number_->setObjectName("frameNumber");
  row->addWidget(play_);
  row->addWidget(slider_, 1);
  row->addWidget(number_);
  return bar;
}

void FramedXray::show_view(std::shared_ptr<const pipeline::Result> result, std::size_t view,
                           const ViewFile& file, int frame) {
  if (view_ != view || file_.file != file.file) play_->setChecked(false);
  result_ = std::move(result);
  view_ = view;
  file_ = file;
  bar_->setVisible(file.frames > 1);
  {
    const QSignalBlocker quiet(slider_);
    slider_->setRange(1, std::max(1, file.frames));
    slider_->setValue(frame);
  }
  show_frame(frame, false);
}

void FramedXray::clear(const QString& why) {
  result_.reset();
  other_frame_.reset();
  file_ = {};
  play_->setChecked(false);
  bar_->hide();
  xray_->clear(why);
}

void FramedXray::show_frame(int frame, bool keeps_zoom) {
  const bool own = frame == file_.frame;
  const bool is_measured = result_->views[view_].rectification.has_value();
  number_->setText(own || !is_measured
                       ? tr("frame %1 of %2").arg(frame).arg(file_.frames)
                       : tr("frame %1 of %2, measured: %3").arg(frame).arg(file_.frames).arg(file_.frame));
  reading_ = !own;
  other_frame_.reset();
  if (own) {
    xray_->show_view(result_, view_, keeps_zoom);
  } else {
    QThreadPool::globalInstance()->start(
        [self = QPointer<FramedXray>(this), file = file_, frame, name = result_->views[view_].name] {
          const auto read = frame_alone(file, frame, name);
          QMetaObject::invokeMethod(
              qApp,
              [self, file = file.file, frame, read] {
                if (self && self->file_.file == file) self->take(frame, read);
              },
              Qt::QueuedConnection);
        });
  }
}

void FramedXray::take(int frame, const std::shared_ptr<const pipeline::Result>& read) {
  if (slider_->value() != frame) return;  // the user has moved on
  reading_ = false;
  if (!read) return xray_->clear(tr("Frame %1 cannot be read").arg(frame));
  other_frame_ = read;
  xray_->show_view(read, 0, true);
  emit frame_read();
}

void FramedXray::play_on() {
  if (reading_ || xray_->is_computing()) return;
  slider_->setValue(slider_->value() < slider_->maximum() ? slider_->value() + 1 : 1);
}

}  // namespace helicarm::gui
