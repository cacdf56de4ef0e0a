// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QColor>
#include <QPainter>

#include "gui/xray/image_frame.h"
#include "gui/xray/residual_scale.h"
#include "helicarm/report/marks.h"

namespace helicarm::gui {

/// Colours of the marks as in the report; marks also differ in shape.
namespace ink {
inline const QColor ball(74, 222, 128), rejected(255, 122, 107), plate(147, 197, 253, 150),
    point(240, 171, 252), tunnel(250, 204, 21), residual(251, 146, 60), tool(239, 68, 68),
    epipolar(94, 234, 242), measure(255, 255, 255), quiet(200, 208, 220), breach(255, 70, 60),
    thin(255, 190, 60);
/// Of registered models, as in the registration's report.
inline const QColor models[] = {{250, 204, 21}, {96, 165, 250}, {240, 171, 252}, {74, 222, 128}};
inline const QColor& of_model(std::size_t number) { return models[number % std::size(models)]; }
}  // namespace ink

/// Draws the detections. Line widths do not depend on zoom; `image_width` sets the radius of the fiducials'
/// circles.
void paint_marks(QPainter& painter, const report::ViewMarks& marks, const ImageFrame& frame, int image_width,
                 const QRectF& bounds, const ResidualScale& residuals);

/// A line with a dark edge, visible on a bright background.
void paint_path(QPainter& painter, const rectification::PixelPath& path, const ImageFrame& frame,
                const QPen& pen);

/// A cross with a central gap, which keeps its target visible; its arms reach from `gap` to `arm`.
void paint_open_cross(QPainter& painter, const QPointF& at, const QColor& colour, double gap = 4,
                      double arm = 10);

}  // namespace helicarm::gui
