// SPDX-License-Identifier: Apache-2.0
#include "gui/window/live_bar.h"

#include <QHelpEvent>
#include <QPainter>
#include <QToolTip>

#include "gui/controller/steps.h"
#include "gui/window/style.h"

namespace helicarm::gui {
namespace {

constexpr int least_indicator = 88, beside_indicator = 46;
/// Part of the depth bar before the tunnel's entry, mm.
constexpr double before_entry_mm = 60;
/// At a larger distance from the axis the depth is drawn without colour.
constexpr double near_axis_mm = 5;

QColor colour_of(Light light) {
  switch (light) {
    case Light::off:
      return style::colours().line;
    case Light::red:
      return style::colours().red;
    case Light::amber:
      return style::colours().amber;
    case Light::green:
      return style::colours().green;
  }
  return {};
}

void paint_indicator(QPainter& painter, const QRectF& box, const StatusIndicator& indicator) {
  painter.setPen(Qt::NoPen);
  painter.setBrush(colour_of(indicator.light));
  const QRectF disc(box.left() + 4, box.center().y() - 9, 18, 18);
  if (indicator.light == Light::red)
    painter.drawRect(disc);  // a distinct shape, for colour-blind users
  else
    painter.drawEllipse(disc);
  painter.setPen(style::colours().quiet);
  painter.drawText(box.adjusted(30, 6, 0, 0), Qt::AlignLeft | Qt::AlignTop, indicator.name);
  painter.setPen(style::colours().text);
  painter.drawText(box.adjusted(30, 0, 0, -6), Qt::AlignLeft | Qt::AlignBottom, indicator.text);
}

QString aim_words(const QString& tunnel, const operation::TunnelAim& aim) {
  const QString off = LiveBar::tr("%1: %2 mm off axis   %3°")
                          .arg(tunnel)
                          .arg(aim.distance_mm, 0, 'f', 1)
                          .arg(aim.angle_deg, 0, 'f', 1);
  if (aim.distance_mm > near_axis_mm) return off;
  return off + LiveBar::tr("   %1 mm %2")
                   .arg(std::abs(aim.depth_mm), 0, 'f', 1)
                   .arg(aim.depth_mm < 0 ? LiveBar::tr("before the entry") : LiveBar::tr("deep"));
}

void paint_depth(QPainter& painter, const QRectF& box, const operation::TunnelAim& aim) {
  const double span = before_entry_mm + aim.length_mm;
  const auto at = [&](double depth) {
    return box.left() + box.width() * std::clamp((depth + before_entry_mm) / span, 0.0, 1.0);
  };
  painter.fillRect(box, style::colours().panel);
  painter.fillRect(QRectF(QPointF(at(0), box.top()), QPointF(at(aim.length_mm), box.bottom())),
                   style::colours().raised);
  painter.fillRect(QRectF(QPointF(box.left(), box.top() + 4), QPointF(at(aim.depth_mm), box.bottom() - 4)),
                   aim.distance_mm > near_axis_mm ? style::colours().line
                   : aim.depth_mm > aim.length_mm ? style::colours().red
                                                  : style::colours().blue);
  painter.setPen(style::colours().text);
  painter.drawLine(QPointF(at(0), box.top()), QPointF(at(0), box.bottom()));
}

}  // namespace

LiveBar::LiveBar(QWidget* parent) : QWidget(parent) {
  setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
  setAccessibleName(tr("Devices and tool"));
}

void LiveBar::show_live(const LiveState& live) {
  const bool resizes = live.indicators.empty() != live_.indicators.empty();
  live_ = live;
  if (resizes) updateGeometry();
  setAccessibleDescription(words());
  update();
}

QSize LiveBar::sizeHint() const {
  constexpr int with_devices = 58, without = 26;
  return {1200, style::scaled(live_.indicators.empty() ? without : with_devices)};
}

QSize LiveBar::minimumSizeHint() const { return {600, sizeHint().height()}; }

QString LiveBar::words() const {
  QStringList all;
  for (const StatusIndicator& indicator : live_.indicators)
    all << QString("%1: %2").arg(indicator.name, indicator.text);
  if (live_.aim) all << (*live_.aim ? aim_words(live_.tunnel, **live_.aim) : sentence_of(live_.aim->error()));
  return all.join("; ");
}

void LiveBar::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.fillRect(rect(), style::colours().panel);
  double left = 8;
  for (const StatusIndicator& indicator : live_.indicators) {
    const int words = std::max(painter.fontMetrics().horizontalAdvance(indicator.name),
                               painter.fontMetrics().horizontalAdvance(indicator.text));
    const double width =
        std::max(least_indicator, words / 20 * 20 + beside_indicator + 20);  // in steps, for a stable layout
    paint_indicator(painter, {left, 0, width, double(height())}, indicator);
    left += width;
  }
  if (live_.indicators.empty()) {
    painter.setPen(style::colours().quiet);
    painter.drawText(rect().adjusted(12, 0, 0, 0), Qt::AlignVCenter, tr("no tracker, no robot"));
  }
  if (!live_.aim) return;
  const QRectF box(left + 10, 0, width() - left - 22, height());
  QFont font = painter.font();
  font.setPixelSize(style::scaled(17));
  painter.setFont(font);
  if (!*live_.aim) {
    painter.setPen(style::colours().amber);
    painter.drawText(box, Qt::AlignVCenter | Qt::TextWordWrap, sentence_of(live_.aim->error()));
    return;
  }
  painter.setPen(style::colours().text);
  painter.drawText(box.adjusted(0, 4, 0, -style::scaled(26)), Qt::AlignLeft | Qt::AlignVCenter,
                   aim_words(live_.tunnel, **live_.aim));
  paint_depth(painter, box.adjusted(0, style::scaled(36), 0, -6), **live_.aim);
}

QString LiveBar::definitions() {
  return tr(
      "ms, s: age of the last pose or state of the device.\n"
      "Off axis: distance of the tool's tip from the tunnel's axis, mm; then the angle between both axes, "
      "degrees.\n"
      "Before the entry, deep: position of the tip along the tunnel's axis from its entry, mm.");
}

bool LiveBar::event(QEvent* event) {
  if (event->type() == QEvent::StyleChange) updateGeometry();
  if (event->type() == QEvent::ToolTip) {
    QStringList all;
    for (const StatusIndicator& indicator : live_.indicators)
      if (!indicator.why.isEmpty()) all << QString("%1: %2").arg(indicator.name, indicator.why);
    all << definitions();
    QToolTip::showText(static_cast<QHelpEvent*>(event)->globalPos(), all.join("\n"), this);
    return true;
  }
  return QWidget::event(event);
}

}  // namespace helicarm::gui
