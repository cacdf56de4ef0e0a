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

/// One X-ray with all that the program found in it. Wheel: zoom about the cursor; middle or left drag: pan;
/// right drag: contrast and brightness; double click: fit. Keys: + - 0 zoom, arrows pan, Shift+arrows (with
/// Ctrl: finer) move a cursor and Enter picks there, L next layer, H hides the marks, M magnifier, W usual
/// window, Esc puts the cursor away.
class XrayView : public QWidget {
  Q_OBJECT
 public:
  explicit XrayView(QWidget* parent = nullptr);
  ~XrayView() override;

  /// Shows a view of a result, or what there is of it yet. What was drawn over the former one goes: picks,
  /// epipolar line, path and tool.
  void show_view(std::shared_ptr<const Result> result, std::size_t view);
  void clear(const QString& why);

  void set_layer(Layer layer);
  Layer layer() const { return wanted_; }
  /// Held until another exposure is shown or the usual window is asked for.
  void set_window(GreyWindow window);
  void set_usual_window();
  std::optional<GreyWindow> window() const;

  void set_picking(bool picking);
  void set_magnifier(bool on);
  /// Whether what the stages found is drawn; what is live is drawn anyway.
  void set_marks_visible(bool visible);
  void fit();

  /// What is drawn over the view: rectified pixels, but for picks.
  void set_epipolar(std::vector<Eigen::Vector2d> rectified);
  void set_path(std::vector<Eigen::Vector2d> rectified);
  void set_tool(std::optional<ImageLine> rectified, const QString& note);
  void set_picks(std::vector<FreshPick> raw);

  /// Whether the wanted layer is still being computed; until then the former one is shown.
  bool is_computing() const { return computing_; }
  /// Raw pixel at a place of the widget and back; nothing off the image.
  std::optional<QPointF> raw_at(const QPointF& place) const;
  std::optional<QPointF> place_of(const QPointF& raw_pixel) const;

  QSize sizeHint() const override { return {640, 640}; }
  QSize minimumSizeHint() const override { return {160, 160}; }

 Q_SIGNALS:
  /// A click or Enter while picking: always raw pixels (docs/frames.md).
  void picked(QPointF raw_pixel);
  void hovered(std::optional<helicarm::gui::MarkUnderCursor> mark);
  void layer_changed(helicarm::gui::Layer layer);
  void window_changed(helicarm::GreyWindow window);
  /// The wanted layer is on the screen.
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
  };

  const ViewResult& view() const { return result_->views[view_]; }
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
  void hover_at(const QPointF& place);
  void hover_over(const std::optional<MarkUnderCursor>& mark);
  void paint_still();
  void paint_magnifier(QPainter& painter) const;
  void paint_words(QPainter& painter) const;

  std::shared_ptr<const Result> result_;
  std::size_t view_ = 0;
  QString why_empty_;
  Layer wanted_ = Layer::rectified;
  std::optional<GreyWindow> window_;  ///< nothing: the usual one
  bool picking_ = false, magnifier_ = false, marks_visible_ = true, computing_ = false, fits_ = true;

  LayerLoader loader_;
  std::shared_ptr<const LoadedLayer> shown_;
  QImage grey_;
  ViewMarks marks_;
  LiveMarks live_;
  ImageFrame frame_;
  QPixmap still_;  ///< image and marks as they stand; null: to be drawn anew

  Drag drag_;
  std::optional<QPointF> mouse_;
  std::optional<Eigen::Vector2d> cursor_;  ///< moved by the keyboard, in the layer's pixels
  std::optional<MarkUnderCursor> under_;
};

}  // namespace helicarm::gui
