// SPDX-License-Identifier: Apache-2.0
#include <QPainter>
#include <QPainterPath>

#include "gui/xray/label_placer.h"
#include "gui/xray/mark_painter.h"
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
  font.setPixelSize(label_font_px);
  return font;
}

/// A cross with a central gap, which keeps its target visible.
void open_cross(QPainter& painter, const QPointF& at, double gap, double arm, const QColor& colour) {
  for (const QPen& pen : {QPen(QColor(0, 0, 0, 180), 3), QPen(colour, 1.2)}) {
    painter.setPen(pen);
    for (const QPointF& way : {QPointF(1, 0), QPointF(0, 1), QPointF(-1, 0), QPointF(0, -1)})
      painter.drawLine(at + gap * way, at + arm * way);
  }
}

}  // namespace

void XrayView::paintEvent(QPaintEvent*) {
  if (still_.isNull()) paint_still();
  QPainter painter(this);
  painter.drawPixmap(0, 0, still_);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.setFont(label_font(font()));
  if (shown_) {
    live_.paint(painter, frame_);
    if (magnifier_) paint_magnifier(painter);
    if (cursor_) open_cross(painter, frame_.to_widget(*cursor_), 4, 16, Qt::white);
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
  paint_marks(painter, marks_, frame_, grey_.width(), rect());
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
  open_cross(painter, at, 8, 30, Qt::white);
  painter.setBrush(Qt::NoBrush);
  painter.setPen(QPen(QColor(255, 255, 255, 170), 2));
  painter.drawEllipse(at, radius, radius);
}

void XrayView::paint_words(QPainter& painter) const {
  if (!shown_) {
    QFont larger = painter.font();
    larger.setPixelSize(label_font_px + 3);
    painter.setFont(larger);
    painter.setPen(ink::quiet);
    painter.drawText(QRectF(rect()).adjusted(24, 24, -24, -24), Qt::AlignCenter | Qt::TextWordWrap,
                     computing_ ? tr("Computing …") : why_empty_);
    return;
  }
  const QString layer = shown_->layer == Layer::raw         ? tr("raw")
                        : shown_->layer == Layer::rectified ? tr("rectified")
                                                            : tr("rectified, plate removed");
  QString caption = QString::fromStdString(view().name) + "  ·  " + layer;
  if (!marks_visible_) caption += tr("  ·  marks hidden");
  if (computing_) caption += tr("  ·  computing …");
  outlined_text(painter, {12, 22}, caption, ink::quiet);
  if (under_) {
    const Eigen::Vector2d& place = under_->kind == MarkUnderCursor::Kind::ball
                                       ? marks_.balls[under_->index].place
                                       : marks_.points[under_->index].place;
    text_box(painter, frame_.to_widget(place), under_->tip, QRectF(rect()).adjusted(6, 6, -6, -6));
  }
}

}  // namespace helicarm::gui
