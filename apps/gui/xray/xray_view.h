// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QPixmap>
#include <QWidget>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "gui/xray/layer_loader.h"
#include "gui/xray/live_marks.h"
#include "gui/xray/mark_groups.h"
#include "gui/xray/measure_marks.h"
#include "gui/xray/model_handle.h"
#include "gui/xray/refusal_text.h"
#include "gui/xray/residual_scale.h"

namespace helicarm::gui {

/// One X-ray image with all detections. Wheel: zoom about the cursor; middle or left drag: pan; right drag:
/// contrast and brightness; double click: fit. Keys: + - 0 zoom, arrows pan, Shift+arrows (with Ctrl: finer)
/// move a cursor and Enter picks there, L next layer, H hides the marks, M magnifier, W default window, D
/// details of a refusal, Esc hides the cursor.
class XrayView : public QWidget {
  Q_OBJECT
 public:
  explicit XrayView(QWidget* parent = nullptr);
  ~XrayView() override;

  /// Shows a view of a result, also an incomplete one. Removes picks, epipolar line, path and tool of the
  /// previous view. Zoom and window are kept for the same image, or if wished.
  void show_view(std::shared_ptr<const pipeline::Result> result, std::size_t view, bool keeps_zoom = false);
  void clear(const QString& why);

  void set_layer(Layer layer);
  Layer layer() const { return wanted_; }
  /// Kept until another image is shown or the default window is requested.
  void set_window(image::GreyWindow window);
  void set_usual_window();
  std::optional<image::GreyWindow> window() const;

  void set_picking(bool picking);
  /// Clicks measure, whether or not they would pick.
  void set_measuring(bool measuring);
  void set_magnifier(bool on);
  /// Whether the detections are drawn; live marks are always drawn.
  void set_marks_visible(bool visible);
  void set_mark_groups(MarkGroups groups);
  /// The caption's word for pixels as they are given, where they are not an image's raw ones.
  void set_given_pixels(const QString& words);
  /// Beside the caption, in amber; empty: none.
  void set_notice(const QString& notice);
  /// Points whose marks are not of their present picks: not drawn.
  void set_stale_points(const std::set<std::string>& points);
  /// Of the residuals' arrows, where it is that of several views.
  void set_residual_scale(const ResidualScale& scale);
  /// Screen px of an image's px; 0 without an image.
  double zoom_factor() const { return shown_ ? frame_.scale : 0; }
  /// The displayed part of the image with its marks, without cursor and magnifier.
  QImage image_with_marks();
  /// The reason of a refused result and, once opened, its details; empty without one.
  QString refusal() const;
  void set_details_visible(bool visible);
  void fit();

  /// Marks over the view: rectified pixels, except picks.
  void set_epipolar(std::vector<rectification::PixelPath> rectified);
  void set_path(std::vector<Eigen::Vector2d> rectified);
  void set_tool(const std::optional<guidance::ImageLine>& rectified, const QString& note);
  void set_outlines(std::vector<ModelOutline> rectified);
  /// Of the model that the left button moves; removed as the picks are.
  void set_handle(const std::optional<ModelHandle>& rectified);
  void set_picks(std::vector<FreshPick> raw);
  /// Drawn over everything; removed as the picks are.
  void set_measures(std::vector<EvaluatedMeasure> measures);
  /// Those that the left button can drag, drawn or not.
  void set_movable_picks(std::vector<FreshPick> raw) { movable_ = std::move(raw); }

  /// Digest of the shown image's pixels; empty without one.
  std::string image() const { return result_ ? view().xray_image->acquisition.instance_key : ""; }
  /// Whether the requested layer is still being computed; until then the previous one is displayed.
  bool is_computing() const { return computing_; }
  /// Raw pixel at a widget position and back; empty outside the image. No pixel as long as the image of the
  /// view before is displayed.
  std::optional<QPointF> raw_at(const QPointF& place) const;
  std::optional<QPointF> place_of(const QPointF& raw_pixel) const;

  QSize sizeHint() const override { return {640, 640}; }
  QSize minimumSizeHint() const override { return {160, 160}; }

 Q_SIGNALS:
  /// A click or Enter while picking: always raw pixels (docs/frames.md).
  void picked(QPointF raw_pixel);
  /// The same while neither picking nor measuring.
  void not_picked();
  /// A click or Enter while measuring.
  void measured(QPointF raw_pixel);
  /// A click of a measure is dragged, while measuring.
  void measure_click_moved(int number, int click, QPointF raw_pixel);
  /// Enter without a cursor while measuring.
  void measure_finished();
  /// A movable pick was dropped at a raw pixel.
  void pick_moved(const QString& name, QPointF raw_pixel);
  /// A right click, without a drag, on a movable pick.
  void pick_menu_wanted(const QString& name, const QPoint& global);
  /// The handle is dragged from one raw pixel to the next. `continues`: the drag has begun before.
  void handle_dragged(helicarm::gui::HandlePart part, QPointF from_raw, QPointF to_raw, bool continues);
  void hovered(std::optional<helicarm::gui::MarkUnderCursor> mark);
  void layer_changed(helicarm::gui::Layer layer);
  void window_changed(helicarm::image::GreyWindow window);
  /// The requested layer is displayed.
  void shown();
  /// The zoom factor has changed.
  void zoomed();

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
    QString pick = {};                    ///< name of the movable pick under the press
    std::optional<ClickMark> click = {};  ///< of a measure, while measuring
    HandlePart handle = HandlePart::none;
    bool has_moved_handle = false;
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
  bool takes_clicks() const { return picking_ || measuring_; }
  void pick_at(const QPointF& place);
  QString movable_at(const QPointF& place) const;
  void move_click(const QPointF& place);
  HandlePart handle_at(const QPointF& place) const;
  void move_handle(const QPointF& from, const QPointF& to);
  void show_moved(const std::optional<QPointF>& raw);
  void hover_at(const QPointF& place);
  void hover_over(const std::optional<MarkUnderCursor>& mark);
  /// Those of the displayed groups, without superseded points.
  report::ViewMarks drawn_marks() const;
  void paint_still();
  void paint_magnifier(QPainter& painter) const;
  void paint_words(QPainter& painter) const;
  void paint_refusal(QPainter& painter) const;
  /// Not over an image in which points are clicked, unless it is asked for.
  bool shows_refusal() const { return refusal_ && (details_visible_ || !takes_clicks()); }
  QRectF refusal_box() const;
  QString refusal_hint() const;
  void paint_readout(QPainter& painter) const;
  void hide_repeated_picks();

  std::shared_ptr<const pipeline::Result> result_;
  std::size_t view_ = 0;
  QString why_empty_;
  Layer wanted_ = Layer::rectified;
  std::optional<image::GreyWindow> window_;  ///< empty: the default one
  bool picking_ = false, measuring_ = false, magnifier_ = false, marks_visible_ = true, computing_ = false,
       fits_ = true, shows_earlier_ = false;

  LayerLoader loader_;
  std::shared_ptr<const LoadedLayer> shown_;
  QImage grey_;
  report::ViewMarks marks_;
  MarkGroups groups_ = all_marks;
  std::vector<FreshPick> picks_;      ///< as given
  std::set<std::string> superseded_;  ///< points whose pick has moved since the result
  std::set<std::string> stale_;       ///< as given
  QString notice_, given_pixels_;
  std::optional<ResidualScale> residual_scale_;  ///< nothing: by this view alone
  std::optional<RefusalText> refusal_;
  bool details_visible_ = false;
  LiveMarks live_;
  MeasureMarks measures_;
  std::optional<ModelHandle> handle_;
  std::optional<Eigen::Vector2d> handle_in_layer_;
  ImageFrame frame_;
  QPixmap still_;  ///< image and marks; null: to be redrawn

  Drag drag_;
  std::vector<FreshPick> movable_;
  std::optional<QPointF> mouse_;
  std::optional<Eigen::Vector2d> cursor_;  ///< moved by the keyboard, in the layer's pixels
  std::optional<MarkUnderCursor> under_;
};

}  // namespace helicarm::gui
