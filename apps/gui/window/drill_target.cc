// SPDX-License-Identifier: Apache-2.0
#include "gui/window/drill_target.h"

#include <QPainter>
#include <algorithm>
#include <cmath>

#include "gui/controller/steps.h"
#include "gui/window/style.h"

namespace helicarm::gui {
namespace {

constexpr double shown_tolerances = 4;  // from the middle to the rim

void paint_cross(QPainter& painter, const QPointF& at, double arm) {
  painter.drawLine(at - QPointF(arm, 0), at + QPointF(arm, 0));
  painter.drawLine(at - QPointF(0, arm), at + QPointF(0, arm));
}

/// Two standard deviations, the tolerances and the causes, in lines that fit beside the target.
QString uncertain_words(const operation::TunnelAim& aim, double tolerance_mm, double tolerance_deg) {
  const auto twice = [](const operation::AimError& error) {
    return DrillTarget::tr("%1 mm, %2°")
        .arg(2 * error.distance_mm, 0, 'f', 1)
        .arg(2 * error.angle_deg, 0, 'f', 1);
  };
  return DrillTarget::tr("uncertain\n2 σ %1\nlimit %2 mm, %3°\nimages %4\ntracker %5\ndrill %6\nscatter %7")
             .arg(twice({aim.distance_sigma_mm, aim.angle_sigma_deg}))
             .arg(tolerance_mm)
             .arg(tolerance_deg)
             .arg(twice(aim.errors->images), twice(aim.errors->tracker), twice(aim.errors->tool),
                  twice(aim.errors->scatter)) +
         DrillTarget::tr("\noff %1 mm, %2°\ndepth %3 mm")
             .arg(aim.distance_mm, 0, 'f', 1)
             .arg(aim.angle_deg, 0, 'f', 1)
             .arg(aim.depth_mm, 0, 'f', 1);
}

}  // namespace

QPointF on_target(const Eigen::Vector2d& in_tolerances, double rim) {
  const double length = in_tolerances.norm();
  const Eigen::Vector2d shown = length > shown_tolerances
                                    ? Eigen::Vector2d(in_tolerances * (shown_tolerances / length))
                                    : in_tolerances;
  return rim / shown_tolerances * QPointF(shown.x(), shown.y());
}

DrillTarget::DrillTarget(QWidget* parent) : QWidget(parent) {
  setAccessibleName(tr("Drill against its tunnel"));
  setToolTip(tr(
      "Seen along the drill, in its own axes. Cross: its tip, from the tunnel's axis; ring: its direction. "
      "The circle is the tolerance, the rim four times as much. Bar: depth of the tip, from the entry to "
      "the tunnel's end. Uncertain: two standard deviations, and those by X-ray images or registration, "
      "tracker, the drill's calibration and the scatter of its poses, whose squares add up."));
}

QSize DrillTarget::sizeHint() const { return {style::scaled(300), style::scaled(190)}; }

void DrillTarget::show_guidance(const std::optional<operation::Guidance>& guidance,
                                const operation::HandDrill& drill) {
  guidance_ = guidance;
  tolerance_mm_ = drill.tolerance_mm;
  tolerance_deg_ = drill.tolerance_deg;
  setAccessibleDescription(words());
  update();
}

/// What to do where nothing is in the way.
QString DrillTarget::words_on_target() const {
  if (!guidance_->aim || guidance_->aim->depth_mm < 0) return tr("on target");
  return is_at_end() ? tr("at the tunnel's end: stop, hold still and verify") : tr("on target: drill");
}

bool DrillTarget::is_at_end() const {
  return guidance_->aim && guidance_->aim->depth_mm >= guidance_->aim->length_mm;
}

QString DrillTarget::words() const {
  if (!guidance_) return tr("not guided");
  QString words = guidance_->why_not ? sentence_of(*guidance_->why_not) : words_on_target();
  if (!guidance_->aim) return words;
  const operation::TunnelAim& aim = *guidance_->aim;
  if (guidance_->why_not && guidance_->why_not->reason == Reason::uncertain && aim.errors)
    return uncertain_words(aim, tolerance_mm_, tolerance_deg_);
  return words + tr("\n%1 ± %2 mm off axis, %3 ± %4°\ndepth %5 of %6 mm")
                     .arg(aim.distance_mm, 0, 'f', 1)
                     .arg(aim.distance_sigma_mm, 0, 'f', 1)
                     .arg(aim.angle_deg, 0, 'f', 1)
                     .arg(aim.angle_sigma_deg, 0, 'f', 1)
                     .arg(aim.depth_mm, 0, 'f', 1)
                     .arg(aim.length_mm, 0, 'f', 1);
}

void DrillTarget::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.fillRect(rect(), style::colours().panel);
  const bool is_on = guidance_ && !guidance_->why_not && !is_at_end();
  const QColor decision = !guidance_ ? style::colours().quiet
                          : is_on    ? style::colours().green
                                     : style::colours().amber;
  const double rim = 0.5 * height() - 12;
  const QPointF middle(rim + 14, 0.5 * height());
  painter.setPen(QPen(style::colours().line, 1));
  painter.drawEllipse(middle, rim, rim);
  paint_cross(painter, middle, rim);
  painter.setPen(QPen(decision, is_on ? 4 : 2));
  painter.drawEllipse(middle, rim / shown_tolerances, rim / shown_tolerances);
  if (guidance_ && guidance_->aim) {
    const operation::TunnelAim& aim = *guidance_->aim;
    painter.setPen(QPen(style::colours().text, 2));
    paint_cross(painter, middle + on_target(-aim.to_axis_mm.head<2>() / tolerance_mm_, rim), 7);
    const Eigen::Vector2d tilt = -aim.axis.head<2>();
    const double sine = tilt.norm();
    if (sine > 0) {
      painter.setPen(QPen(style::colours().blue, 2));
      painter.drawEllipse(middle + on_target(aim.angle_deg / tolerance_deg_ / sine * tilt, rim), 6, 6);
    }
    const QRectF bar(middle.x() + rim + 14, 12, 14, height() - 24);
    const double share = std::clamp(aim.depth_mm / std::max(aim.length_mm, 1e-3), 0.0, 1.0);
    painter.fillRect(bar, style::colours().raised);
    painter.fillRect(QRectF(bar.left(), bar.top(), bar.width(), share * bar.height()),
                     aim.depth_mm > aim.length_mm ? style::colours().red : style::colours().blue);
  }
  painter.setPen(decision);
  const double left = middle.x() + rim + 40;
  painter.drawText(QRectF(left, 8, width() - left - 8, height() - 16), Qt::AlignVCenter | Qt::TextWordWrap,
                   words());
}

}  // namespace helicarm::gui
