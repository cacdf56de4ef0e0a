// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QLabel>
#include <QPushButton>
#include <QSlider>
#include <QTimer>
#include <QWidget>

namespace helicarm::gui {

/// Plays the frames of a film, numbered from 0: a button, a slider, and the name of the displayed frame.
class FilmBar : public QWidget {
  Q_OBJECT

 public:
  /// `name`: begins the object names of its parts.
  explicit FilmBar(const QString& name);

  void set_count(int frames) { slider_->setRange(0, frames - 1); }
  int frame() const { return slider_->value(); }
  void set_frame(int number) { slider_->setValue(number); }
  bool is_last() const { return slider_->value() == slider_->maximum(); }
  void set_name(const QString& displayed) { name_->setText(displayed); }
  void stop() { clock_.stop(); }
  /// While the wanted frame is not displayed yet, the film waits.
  void set_waiting(bool waits) { waits_ = waits; }

 Q_SIGNALS:
  void frame_wanted(int number);

 private:
  void play();
  void play_on();

  QPushButton* play_ = nullptr;
  QSlider* slider_ = nullptr;
  QLabel* name_ = nullptr;
  QTimer clock_;
  bool waits_ = false;
};

}  // namespace helicarm::gui
