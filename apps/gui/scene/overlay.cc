// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/overlay.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "gui/scene/palette.h"

namespace helicarm::gui {
namespace {

QColor qcolor(const Colour& colour, int alpha = 255) { return {colour[0], colour[1], colour[2], alpha}; }

void paint_plate(QPainter& painter, const QRect& box, const QString& text, const Colour& colour) {
  painter.fillRect(box, qcolor(palette::background, 190));
  painter.setPen(qcolor(colour));
  painter.drawText(box, Qt::AlignCenter, text);
}

}  // namespace

void paint_labels(QPainter& painter, const QSize& size, const SceneCamera& camera,
                  const std::vector<SceneLabel>& labels, std::vector<QRect> taken) {
  const double aspect = double(size.width()) / size.height();
  const QFontMetrics metrics = painter.fontMetrics();
  for (const SceneLabel& label : labels) {
    const auto seen = seen_at(camera, aspect, label.place);
    if (!seen || std::abs(seen->x()) > 1 || std::abs(seen->y()) > 1) continue;
    const QPoint at(int((seen->x() + 1) / 2 * size.width()), int((1 - seen->y()) / 2 * size.height()));
    const QSize box(metrics.horizontalAdvance(label.text) + 6, metrics.height());
    const int right = at.x() + 6, left = at.x() - 6 - box.width();
    const int above = at.y() - 4 - box.height(), below = at.y() + 4, beside = at.y() - box.height() / 2;
    std::vector<QRect> choices;
    for (const QPoint& corner : {QPoint(right, above), QPoint(right, below), QPoint(left, above),
                                 QPoint(left, below), QPoint(right + 14, beside), QPoint(left - 14, beside),
                                 QPoint(left - 50, above), QPoint(left - 50, below)})
      choices.emplace_back(corner, box);
    const QRect window(QPoint(0, 0), size);
    const auto free = std::ranges::find_if(choices, [&](const QRect& choice) {
      return window.contains(choice) &&
             std::ranges::none_of(taken, [&](const QRect& other) { return choice.intersects(other); });
    });
    if (free == choices.end()) continue;
    taken.push_back(*free);
    paint_plate(painter, taken.back(), label.text, label.colour);
  }
}

void paint_triad(QPainter& painter, const QSize& size, const SceneCamera& camera) {
  constexpr int length = 26, inset = 44;
  const QPoint origin(inset, size.height() - inset);
  std::array<int, 3> order{0, 1, 2};  // the nearest last
  std::ranges::sort(order, std::greater(), [&](int axis) { return camera.forward()[axis]; });
  for (const int axis : order) {
    const Colour& colour = palette::axes[std::size_t(axis)];
    const QPointF tip(length * camera.right()[axis], -length * camera.up[axis]);
    painter.setPen(QPen(qcolor(colour), 2));
    painter.drawLine(origin, origin + tip.toPoint());
    const QPointF name = 1.4 * tip;
    const QRect box(origin.x() + int(name.x()) - 10, origin.y() + int(name.y()) - 10, 20, 20);
    painter.drawText(box, Qt::AlignCenter, QStringLiteral("xyz").mid(axis, 1));
  }
}

QRect paint_colour_bar(QPainter& painter, const QSize& size, const QString& title, const TreScale& scale) {
  constexpr int width = 14, strips = 40;
  const QFontMetrics metrics = painter.fontMetrics();
  const int count = int(std::lround((scale.high - scale.low) / scale.step));
  const int decimals = std::max(0, -int(std::floor(std::log10(scale.step) + 1e-9)));
  const auto mark = [&](int k) { return QString::number(scale.low + k * scale.step, 'f', decimals); };
  const int marks_width =
      std::max(metrics.horizontalAdvance(mark(0)), metrics.horizontalAdvance(mark(count)));
  const int height = std::clamp(size.height() / 2, 60, 240), top = (size.height() - height) / 2;
  const int left = size.width() - width - marks_width - 18;
  const QRect plate(left - 8, top - 10, size.width() - left + 8, height + 20);
  painter.fillRect(plate, qcolor(palette::background, 190));
  for (int k = 0; k < strips; ++k) {
    const int from = top + height * k / strips, to = top + height * (k + 1) / strips;
    painter.fillRect(left, from, width, to - from, qcolor(colour_of(1 - (k + 0.5) / strips)));
  }
  painter.setPen(qcolor(palette::text));
  for (int k = 0; k <= count; ++k) {
    const int y = top + height - height * k / count;
    painter.drawLine(left + width, y, left + width + 4, y);
    painter.drawText(QRect(left + width + 7, y - 10, marks_width + 4, 20), Qt::AlignLeft | Qt::AlignVCenter,
                     mark(k));
  }
  const int title_width = metrics.horizontalAdvance(title) + 12;
  const QRect head(size.width() - title_width - 4, plate.top() - metrics.height() - 4, title_width,
                   metrics.height() + 4);
  paint_plate(painter, head, title, palette::text);
  return plate.united(head);
}

QRect paint_note(QPainter& painter, int line, const QString& text, const Colour& colour) {
  const QFontMetrics metrics = painter.fontMetrics();
  const QRect box(6, 6 + line * (metrics.height() + 2), metrics.horizontalAdvance(text) + 10,
                  metrics.height() + 2);
  paint_plate(painter, box, text, colour);
  return box;
}

}  // namespace helicarm::gui
