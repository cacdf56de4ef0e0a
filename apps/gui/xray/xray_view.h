// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QPixmap>
#include <QWidget>
#include <memory>
#include <optional>
#include <vector>

#include "gui/xray/layer_loader.h"
#include "gui/xray/live_marks.h"

namespace helicarm::gui {

/// One X-ray image with all detections. Wheel: zoom about the cursor; middle or left drag: pan; right drag:
/// contrast and brightness; double click: fit. Keys: + - 0 zoom, arrows pan, Shift+arrows (with Ctrl: finer)
/// move a cursor and Enter picks there, L next layer, H hides the marks, M magnifier, W default window, Esc
/// hides the cursor.
class XrayView : public QWidget {
  Q_OBJECT
 public:
  explicit XrayView(QWidget* parent = nullptr);
  ~XrayView() override;

  /// Shows a view of a result, also an incomplete one. Removes picks, epipolar line, path and tool of the
  /// previous view.
  void show_view(std::shared_ptr<const pipeline::Result> result, std::size_t view);
  void clear(const QString& why);

  void set_layer(Layer layer);
  Layer layer() const { return wanted_; }
  /// Kept until another image is shown or the default window is requested.
  void set_window(image::GreyWindow window);
  void set_usual_window();
  std::optional<image::GreyWindow> window() const;

  void set_picking(bool picking);
  void set_magnifier(bool on);
  /// Whether the detections are drawn; live marks are always drawn.
  void set_marks_visible(bool visible);
  void fit();

  /// Marks over the view: rectified pixels, except picks.
  void set_epipolar(std::vector<Eigen::Vector2d> rectified);
  void set_path(std::vector<Eigen::Vector2d> rectified);
  void set_tool(const std::optional<verification::ImageLine>& rectified, const QString& note);
  void set_picks(std::vector<FreshPick> raw);
  /// Those that the left button can drag, drawn or not.
  void set_movable_picks(std::vector<FreshPick> raw) { movable_ = std::move(raw); }

  /// Whether the requested layer is still being computed; until then the previous one is displayed.
  bool is_computing() const { return computing_; }
  /// Raw pixel at a widget position and back; empty outside the image.
  std::optional<QPointF> raw_at(const QPointF& place) const;
  std::optional<QPointF> place_of(const QPointF& raw_pixel) const;

  QSize sizeHint() const override { return {640, 640}; }
  QSize minimumSizeHint() const override { return {160, 160}; }

 Q_SIGNALS:
  /// A click or Enter while picking: always raw pixels (docs/frames.md).
  void picked(QPointF raw_pixel);
  /// A movable pick was dropped at a raw pixel.
  void pick_moved(const QString& name, QPointF raw_pixel);
  void hovered(std::optional<helicarm::gui::MarkUnderCursor> mark);
  void layer_changed(helicarm::gui::Layer layer);
  void window_changed(helicarm::image::GreyWindow window);
  /// The requested layer is displayed.
  void shown();

 protected:
  void paintEvent(QPaintEvent* event) override;
  void resizeEvent(QResizeEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void mouseReleaseEvent(QMouseEvent* event) override;
  void mouseDoubleClickEvent(QMouseEvent* event) override;
  void enterEvent(QEnterEvent* event) override;
  void leaveEvent(QEvent* event) override;
  void keyPressEvent(QKeyEvent* event) override;

 private:
  struct Drag {
    Qt::MouseButton button = Qt::NoButton;
    QPointF from, last;
    bool moved = false;
    bool may_pick = false;
    QString pick = {};  ///< name of the movable pick under the press
  };

  const pipeline::ViewResult& view() const { return result_->views[view_]; }
  QSizeF image_size() const;
  void take(const std::shared_ptr<const LoadedLayer>& layer);
  void window_image();
  void carry_live();
  void redraw_still();
  void zoom(double factor, const QPointF& about);
  void pan(const QPointF& by);
  void adjust_window(const QPointF& by);
  void move_cursor(const QPointF& by);
  void pick_at(const QPointF& place);
  QString movable_at(const QPointF& place) const;
  void show_moved(const std::optional<QPointF>& raw);
  void hover_at(const QPointF& place);
  void hover_over(const std::optional<MarkUnderCursor>& mark);
  void paint_still();
  void paint_magnifier(QPainter& painter) const;
  void paint_words(QPainter& painter) const;

  std::shared_ptr<const pipeline::Result> result_;
  std::size_t view_ = 0;
  QString why_empty_;
  Layer wanted_ = Layer::rectified;
  std::optional<image::GreyWindow> window_;  ///< empty: the default one
  bool picking_ = false, magnifier_ = false, marks_visible_ = true, computing_ = false, fits_ = true;

  LayerLoader loader_;
  std::shared_ptr<const LoadedLayer> shown_;
  QImage grey_;
  report::ViewMarks marks_;
  LiveMarks live_;
  ImageFrame frame_;
  QPixmap still_;  ///< image and marks; null: to be redrawn

  Drag drag_;
  std::vector<FreshPick> movable_;
  std::optional<QPointF> mouse_;
  std::optional<Eigen::Vector2d> cursor_;  ///< moved by the keyboard, in the layer's pixels
  std::optional<MarkUnderCursor> under_;
};

}  // namespace helicarm::gui
