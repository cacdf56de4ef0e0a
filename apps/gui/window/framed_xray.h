// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QLabel>
#include <QPushButton>
#include <QSlider>
#include <QTimer>
#include <QWidget>

#include "gui/controller/application_state.h"
#include "gui/xray/xray_view.h"

namespace helicarm::gui {

/// A large X-ray image. A slider chooses the frame of a file with several; detections and picks belong to the
/// view's own frame, the others are for looking.
class FramedXray : public QWidget {
  Q_OBJECT

 public:
  explicit FramedXray(QWidget* parent = nullptr);

  XrayView& xray() { return *xray_; }
  const XrayView& xray() const { return *xray_; }
  /// As `XrayView::show_view`, with this frame of the view's file.
  void show_view(std::shared_ptr<const pipeline::Result> result, std::size_t view, const ViewFile& file,
                 int frame);
  void clear(const QString& why);

  /// Nothing if no image is displayed.
  std::optional<std::size_t> view() const { return result_ ? std::optional(view_) : std::nullopt; }
  bool shows_own_frame() const { return slider_->value() == file_.frame; }
  /// The displayed frame as a result without detections; null if it is the view's own.
  const std::shared_ptr<const pipeline::Result>& other_frame() const { return other_frame_; }
  void set_frame(int frame) { slider_->setValue(frame); }

 signals:
  void frame_changed(std::size_t view, int frame);
  /// A frame that is not the view's own is displayed.
  void frame_read();

 private:
  QWidget* build_bar();
  void show_frame(int frame, bool keeps_zoom);
  void take(int frame, const std::shared_ptr<const pipeline::Result>& read);
  void play_on();

  XrayView* xray_;
  QWidget* bar_;
  QPushButton* play_;
  QSlider* slider_;
  QLabel* number_;
  QTimer clock_;

  std::shared_ptr<const pipeline::Result> result_, other_frame_;
  std::size_t view_ = 0;
  ViewFile file_;
  bool reading_ = false;
};

}  // namespace helicarm::gui
