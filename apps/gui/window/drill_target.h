// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QWidget>
#include <optional>

#include "helicarm/operation/freehand.h"

namespace helicarm::gui {

/// A hand-held drill against its tunnel, seen along the tunnel: the tip as a cross and the drill's direction
/// as a ring, in the drill's own axes, within circles of the tolerances; depth as a bar; the decision in
/// words. Both go to the middle.
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
  std::optional<operation::Guidance> guidance_;
  double tolerance_mm_ = 1, tolerance_deg_ = 2;
};

}  // namespace helicarm::gui
