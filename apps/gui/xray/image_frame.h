// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QPointF>
#include <QRectF>
#include <QSizeF>
#include <algorithm>

#include <Eigen/Core>

namespace helicarm::gui {

/// Position of an image in a widget: widget = origin + scale * pixel. Pixel (0, 0) is the centre of the
/// top-left one.
struct ImageFrame {
  double scale = 1;
  QPointF origin;

  static constexpr double largest_scale = 64;

  QPointF to_widget(const Eigen::Vector2d& pixel) const {
    return origin + scale * QPointF(pixel.x(), pixel.y());
  }
  Eigen::Vector2d to_image(const QPointF& place) const {
    const QPointF pixel = (place - origin) / scale;
    return {pixel.x(), pixel.y()};
  }

  /// The whole image, centred in the widget.
  static ImageFrame fitted(const QSizeF& image, const QSizeF& widget) {
    const double scale = std::clamp(std::min(widget.width() / std::max(1.0, image.width()),
                                             widget.height() / std::max(1.0, image.height())),
                                    1e-3, largest_scale);
    const QPointF corner(widget.width() - scale * image.width(), widget.height() - scale * image.height());
    return {scale, 0.5 * corner + QPointF(0.5 * scale, 0.5 * scale)};
  }

  /// Enlarged about a widget position, whose pixel stays.
  ImageFrame zoomed(double factor, const QPointF& about, double smallest_scale) const {
    const double to = std::clamp(scale * factor, smallest_scale, largest_scale);
    return {to, about + to / scale * (origin - about)};
  }

  /// Shifted back until part of the image is visible.
  ImageFrame within(const QSizeF& image, const QSizeF& widget) const {
    constexpr double strip = 48;
    ImageFrame held = *this;
    held.origin.setX(std::clamp(origin.x(), strip - scale * image.width(), widget.width() - strip));
    held.origin.setY(std::clamp(origin.y(), strip - scale * image.height(), widget.height() - strip));
    return held;
  }
};

}  // namespace helicarm::gui
