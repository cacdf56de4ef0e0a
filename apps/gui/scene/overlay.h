// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QPainter>
#include <QString>
#include <vector>

#include "gui/scene/scene_camera.h"
#include "gui/scene/tre_slice.h"

namespace helicarm::gui {

/// A name at a place in the calibrator's frame.
struct SceneLabel {
  Eigen::Vector3d place;
  QString text;
  Colour colour;
};

/// Each beside its place on a dark plate; one that would cover another or what is `taken` steps aside, or is
/// left out.
void paint_labels(QPainter& painter, const QSize& size, const SceneCamera& camera,
                  const std::vector<SceneLabel>& labels, std::vector<QRect> taken);

/// The calibrator's axes in the lower left corner.
void paint_triad(QPainter& painter, const QSize& size, const SceneCamera& camera);

/// At the right edge, with marks and unit; gives its place.
QRect paint_colour_bar(QPainter& painter, const QSize& size, const QString& title, const TreScale& scale);

/// A line of text in the upper left corner; gives its place.
QRect paint_note(QPainter& painter, int line, const QString& text, const Colour& colour);

}  // namespace helicarm::gui
