// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QPointF>
#include <QRectF>
#include <QSizeF>
#include <algorithm>

#include <Eigen/Core>

namespace helicarm::gui {

/// Where a picture lies in a widget: widget = origin + scale * pixel. Pixel (0, 0) is the centre of the
/// top-left one.
struct PictureFrame {
  double scale = 1;
  QPointF origin;

  static constexpr double largest_scale = 64;

  QPointF to_widget(const Eigen::Vector2d& pixel) const {
    return origin + scale * QPointF(pixel.x(), pixel.y());
  }
  Eigen::Vector2d to_picture(const QPointF& place) const {
    const QPointF pixel = (place - origin) / scale;
    return {pixel.x(), pixel.y()};
  }

  /// The whole picture in the middle of the widget.
  static PictureFrame fitted(const QSizeF& picture, const QSizeF& widget) {
    const double scale = std::clamp(std::min(widget.width() / std::max(1.0, picture.width()),
                                             widget.height() / std::max(1.0, picture.height())),
                                    1e-3, largest_scale);
    const QPointF corner(widget.width() - scale * picture.width(),
                         widget.height() - scale * picture.height());
    return {scale, 0.5 * corner + QPointF(0.5 * scale, 0.5 * scale)};
  }

  /// Enlarged about a place of the widget, which keeps its pixel.
  PictureFrame zoomed(double factor, const QPointF& about, double smallest_scale) const {
    const double to = std::clamp(scale * factor, smallest_scale, largest_scale);
    return {to, about + to / scale * (origin - about)};
  }

  /// Shifted back until a strip of the picture shows.
  PictureFrame within(const QSizeF& picture, const QSizeF& widget) const {
    constexpr double strip = 48;
    PictureFrame held = *this;
    held.origin.setX(std::clamp(origin.x(), strip - scale * picture.width(), widget.width() - strip));
    held.origin.setY(std::clamp(origin.y(), strip - scale * picture.height(), widget.height() - strip));
    return held;
  }
};

}  // namespace helicarm::gui
