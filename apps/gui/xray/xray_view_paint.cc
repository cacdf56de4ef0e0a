// SPDX-License-Identifier: Apache-2.0
#include <QPainter>
#include <QPainterPath>

#include "gui/xray/label_placer.h"
#include "gui/xray/mark_painter.h"
#include "gui/xray/readout.h"
#include "gui/xray/xray_view.h"

namespace helicarm::gui {
namespace {

const QColor ground(13, 16, 21);

void draw_image(QPainter& painter, const QImage& image, const ImageFrame& frame) {
  painter.save();
  painter.setRenderHint(QPainter::SmoothPixmapTransform);
  painter.translate(frame.origin);
  painter.scale(frame.scale, frame.scale);
  painter.drawImage(QPointF(-0.5, -0.5), image);
  painter.restore();
}

QFont label_font(QFont font) {
  font.setPixelSize(font.pixelSize() > 0 ? font.pixelSize() - 1 : label_font_px);
  return font;
}

}  // namespace

void XrayView::paintEvent(QPaintEvent*) {
  if (still_.isNull()) paint_still();
  QPainter painter(this);
  painter.drawPixmap(0, 0, still_);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.setFont(label_font(font()));
  if (shown_) {
    live_.paint(painter, frame_, QRectF(rect()).adjusted(6, 6, -6, -6));
    measures_.paint(painter, frame_);
    if (handle_ && handle_in_layer_)
      paint_handle(painter, frame_.to_widget(*handle_in_layer_), handle_->colour);
    if (magnifier_) paint_magnifier(painter);
    if (cursor_) paint_open_cross(painter, frame_.to_widget(*cursor_), Qt::white, 4, 16);
  }
  paint_words(painter);
  if (hasFocus()) {
    painter.setPen(QPen(palette().highlight().color(), 2));
    painter.setBrush(Qt::NoBrush);
    painter.drawRect(QRectF(rect()).adjusted(1, 1, -1, -1));
  }
}

void XrayView::paint_still() {
  still_ = QPixmap(size() * devicePixelRatioF());
  still_.setDevicePixelRatio(devicePixelRatioF());
  still_.fill(ground);
  if (!shown_) return;
  QPainter painter(&still_);
  draw_image(painter, grey_, frame_);
  if (!marks_visible_) return;
  painter.setRenderHint(QPainter::Antialiasing);
  painter.setFont(label_font(font()));
  paint_marks(painter, drawn_marks(), frame_, grey_.width(), rect(),
              residual_scale_.value_or(residual_scale(*result_, frame_.scale)));
}

report::ViewMarks XrayView::drawn_marks() const {
  report::ViewMarks marks = only(groups_, marks_);
  std::erase_if(marks.points, [&](const report::PointMark& mark) { return superseded_.contains(mark.name); });
  if (!superseded_.empty()) {  // they join the earlier places
    marks.tunnels.clear();
    marks.tool_lines.clear();
  }
  return marks;
}

QImage XrayView::image_with_marks() {
  if (still_.isNull()) paint_still();
  QImage image = still_.toImage();
  if (!shown_) return image;
  QPainter painter(&image);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.setFont(label_font(font()));
  live_.paint(painter, frame_, QRectF(rect()).adjusted(6, 6, -6, -6));
  measures_.paint(painter, frame_);
  return image;
}

QRectF XrayView::refusal_box() const {
  constexpr int rim = 10, above_the_scale = 52;
  const QRectF widest = QRectF(rect()).adjusted(8 + rim, 34, -8 - rim, -above_the_scale);
  const QRectF text = QFontMetricsF(label_font(font()))
                          .boundingRect(widest, Qt::TextWordWrap, refusal() + '\n' + refusal_hint());
  return {8, widest.bottom() - text.height(), width() - 16.0, text.height() + 2 * rim};
}

QString XrayView::refusal_hint() const {
  return details_visible_ ? tr("Click here or press D: less")
                          : tr("Click here or press D: causes and figures");
}

void XrayView::paint_refusal(QPainter& painter) const {
  constexpr int rim = 10;
  const QRectF box = refusal_box();
  painter.setPen(QPen(ink::rejected, 2));
  painter.setBrush(QColor(16, 20, 26, 225));
  painter.drawRoundedRect(box, 6, 6);
  painter.setPen(QColor(240, 243, 247));
  painter.drawText(box.adjusted(rim, rim, -rim, -rim), Qt::TextWordWrap, refusal());
  painter.setPen(ink::quiet);
  painter.drawText(box.adjusted(rim, rim, -rim, -rim), Qt::AlignBottom | Qt::AlignLeft | Qt::TextWordWrap,
                   refusal_hint());
}

void XrayView::paint_magnifier(QPainter& painter) const {
  constexpr double radius = 90, power = 3;
  if (!mouse_ && !cursor_) return;
  const QPointF at = cursor_ ? frame_.to_widget(*cursor_) : *mouse_;
  QPainterPath glass;
  glass.addEllipse(at, radius, radius);
  painter.save();
  painter.setClipPath(glass);
  painter.fillRect(glass.boundingRect(), ground);
  draw_image(painter, grey_, {power * frame_.scale, at + power * (frame_.origin - at)});
  painter.restore();
  paint_open_cross(painter, at, Qt::white, 8, 30);
  painter.setBrush(Qt::NoBrush);
  painter.setPen(QPen(QColor(255, 255, 255, 170), 2));
  painter.drawEllipse(at, radius, radius);
}

void XrayView::paint_words(QPainter& painter) const {
  if (!shown_) {
    QFont larger = painter.font();
    larger.setPixelSize(larger.pixelSize() + 3);
    painter.setFont(larger);
    painter.setPen(ink::quiet);
    painter.drawText(QRectF(rect()).adjusted(24, 24, -24, -24), Qt::AlignCenter | Qt::TextWordWrap,
                     computing_ ? tr("Computing …") : why_empty_);
    return;
  }
  const QString given = given_pixels_.isEmpty() ? tr("raw") : given_pixels_;
  const QString layer = shown_->layer == Layer::raw         ? given
                        : shown_->layer == Layer::rectified ? tr("rectified")
                                                            : tr("rectified, plate removed");
  QString caption = QString::fromStdString(view().name) + "  ·  " + layer;
  if (!marks_visible_) caption += tr("  ·  marks hidden");
  if (computing_) caption += tr("  ·  computing …");
  outlined_text(painter, {12, 22}, caption, ink::quiet);
  if (!notice_.isEmpty())
    outlined_text(painter, {12, 22.0 + painter.fontMetrics().height()}, notice_, ink::tunnel);
  paint_readout(painter);
  if (shows_refusal()) paint_refusal(painter);
  if (under_)
    text_box(painter, frame_.to_widget(under_->place), under_->tip, QRectF(rect()).adjusted(6, 6, -6, -6));
}

void XrayView::paint_readout(QPainter& painter) const {
  if (!cursor_ && !mouse_) return;
  const auto raw = raw_at(cursor_ ? frame_.to_widget(*cursor_) : *mouse_);
  if (!raw) return;
  const QString words = readout_of(*result_, view_, {raw->x(), raw->y()});
  const double wide = painter.fontMetrics().horizontalAdvance(words);
  constexpr double below_caption = 40;
  outlined_text(painter, {std::max(12.0, width() - 12 - wide), below_caption}, words, ink::quiet);
}

}  // namespace helicarm::gui
