// SPDX-License-Identifier: Apache-2.0
#include "gui/window/film_bar.h"

#include <QHBoxLayout>

namespace helicarm::gui {

FilmBar::FilmBar(const QString& name) {
  constexpr int frame_ms = 100;
  auto* row = new QHBoxLayout(this);
  row->setContentsMargins(0, 0, 0, 0);
  play_ = new QPushButton(tr("&Play"));
  play_->setObjectName(name + "Play");
  play_->setAutoDefault(false);
  connect(play_, &QPushButton::clicked, this, &FilmBar::play);
  slider_ = new QSlider(Qt::Horizontal);
  slider_->setObjectName(name + "Slider");
  slider_->setAccessibleName(tr("Frame"));
  connect(slider_, &QSlider::valueChanged, this, &FilmBar::frame_wanted);
  name_ = new QLabel;
  row->addWidget(play_);
  row->addWidget(slider_, 1);
  row->addWidget(name_);
  connect(&clock_, &QTimer::timeout, this, &FilmBar::play_on);
  clock_.setInterval(frame_ms);
}

void FilmBar::play() {
  if (clock_.isActive()) return clock_.stop();
  if (is_last()) slider_->setValue(0);
  clock_.start();
}

void FilmBar::play_on() {
  if (waits_) return;
  if (is_last()) return clock_.stop();
  slider_->setValue(slider_->value() + 1);
}

}  // namespace helicarm::gui
