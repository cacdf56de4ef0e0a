// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QWidget>
#include <optional>

#include "helicarm/operation/freehand.h"

namespace helicarm::gui {

/// Where an offset in the drill's axes, in tolerances, is drawn from the middle; at most at the rim, so that
/// what lies beyond stays in sight. Seen from behind along the drill, whose z points forward: x to the right,
/// y down.
QPointF on_target(const Eigen::Vector2d& in_tolerances, double rim);

/// A hand-held drill against its tunnel, seen from behind along it: the tip as a cross and the drill's
/// direction as a ring, in the drill's own axes, within circles of the tolerances; depth as a bar; the
/// decision in words. Both go to the middle.
class DrillTarget : public QWidget {
  Q_OBJECT

 public:
  explicit DrillTarget(QWidget* parent = nullptr);

  void show_guidance(const std::optional<operation::Guidance>& guidance, const operation::HandDrill& drill);
  /// The displayed content as text.
  QString words() const;

  QSize sizeHint() const override;
  QSize minimumSizeHint() const override { return sizeHint(); }

 protected:
  void paintEvent(QPaintEvent* event) override;

 private:
  QString words_on_target() const;
  bool is_at_end() const;

  std::optional<operation::Guidance> guidance_;
  double tolerance_mm_ = 1, tolerance_deg_ = 2;
};

}  // namespace helicarm::gui
