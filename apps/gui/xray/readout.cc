// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/readout.h"

#include <QObject>
#include <cmath>

#include "helicarm/measures/object_plane.h"

namespace helicarm::gui {
namespace {

using Eigen::Vector2d;

/// A place in mm and of which plane.
struct Place {
  Vector2d mm;
  QString plane;
};

std::optional<Place> place_of(const pipeline::Result& result, const pipeline::ViewResult& view,
                              const Vector2d& raw) {
  if (!view.rectification) return std::nullopt;
  const rectification::DistortionMap& map = view.rectification->map;
  const auto rectified = rectification::rectified_in_image(map, raw);
  if (!rectified) return std::nullopt;
  if (view.calibrated && !result.calibrator.balls.empty()) {
    phantom::Calibrator calibrator;
    calibrator.balls = result.calibrator.balls;
    const auto plane = measures::plane_through(*view.calibrated, phantom::middle_of(calibrator));
    if (plane) return Place{plane->place_of(*rectified), QObject::tr("mm at the calibrator")};
  }
  if (!map.rectified_pixel_mm || !map.rectified_plane) return std::nullopt;
  const Vector2d centre(0.5 * (map.width - 1), 0.5 * (map.height - 1));
  return Place{*map.rectified_pixel_mm * (*rectified - centre),
               *map.rectified_plane == rectification::RectifiedPlane::detector
                   ? QObject::tr("mm on the detector")
                   : QObject::tr("mm on the plate")};
}

}  // namespace

QString readout_of(const pipeline::Result& result, std::size_t index, const Vector2d& raw) {
  const pipeline::ViewResult& view = result.views[index];
  if (!view.xray_image) return {};
  const image::Image<float>& pixels = view.xray_image->pixels;
  const int u = int(std::lround(raw.x())), v = int(std::lround(raw.y()));
  if (u < 0 || v < 0 || u >= pixels.width() || v >= pixels.height()) return {};
  QString words = QObject::tr("%1, %2 px  ·  grey %3")
                      .arg(raw.x(), 0, 'f', 1)
                      .arg(raw.y(), 0, 'f', 1)
                      .arg(double(pixels(u, v)), 0, 'g', 6);
  if (const auto place = place_of(result, view, raw))
    words += QString("  ·  %1, %2 %3")
                 .arg(place->mm.x(), 0, 'f', 1)
                 .arg(place->mm.y(), 0, 'f', 1)
                 .arg(place->plane);
  return words;
}

}  // namespace helicarm::gui
