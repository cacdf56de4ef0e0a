// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QPainter>
#include <QString>
#include <vector>

#include "gui/scene/scene_camera.h"
#include "gui/scene/tre_slice.h"

namespace helicarm::gui {

/// A name at a position in the calibrator's frame.
struct SceneLabel {
  Eigen::Vector3d place;
  QString text;
  Colour colour;
};

/// Draws each label beside its position on a dark background; a label that would cover another or a `taken`
/// area is moved or left out.
void paint_labels(QPainter& painter, const QSize& size, const SceneCamera& camera,
                  const std::vector<SceneLabel>& labels, std::vector<QRect> taken);

/// The calibrator's axes in the lower left corner.
void paint_triad(QPainter& painter, const QSize& size, const SceneCamera& camera);

/// At the right edge, with ticks and unit; returns its area.
QRect paint_colour_bar(QPainter& painter, const QSize& size, const QString& title, const TreScale& scale);

/// A line of text in the upper left corner; returns its area.
QRect paint_note(QPainter& painter, int line, const QString& text, const Colour& colour);

}  // namespace helicarm::gui
