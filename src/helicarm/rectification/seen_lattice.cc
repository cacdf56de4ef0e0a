// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/seen_lattice.h"

#include <algorithm>
#include <cmath>

namespace helicarm::rectification {
namespace {

std::vector<detection::Dot> with_radius_near(const std::vector<detection::Dot>& dots, double radius) {
  std::vector<detection::Dot> near;
  for (const detection::Dot& dot : dots)
    if (dot.radius_px > 0.7 * radius && dot.radius_px < 1.35 * radius) near.push_back(dot);
  return near;
}

}  // namespace

std::optional<double> expected_scale(const xray::XrayImage& xray_image, const phantom::Plate& plate) {
  const auto& pixel = xray_image.acquisition.pixel_mm;
  if (!pixel) return std::nullopt;
  const double height = plate.height_above_receiver_mm.value_or(0);
  const double distance = xray_image.acquisition.source_detector_mm.value_or(1000);
  return distance / (distance - height) / std::sqrt(pixel->x() * pixel->y());
}

SeenLattice seen_lattice(const std::vector<detection::Dot>& dots, const phantom::Plate& plate,
                         std::optional<double> scale) {
  SeenLattice best;
  const auto consider = [&](std::vector<detection::Dot> some, std::optional<double> pitch_px) {
    LatticeOptions options;
    options.pitch_px = pitch_px;
    IndexedLattice lattice = index_lattice(some, plate.lattice, options);
    if (lattice.dots.size() > best.lattice.dots.size()) best = {std::move(some), std::move(lattice)};
  };
  if (scale && plate.pitch_mm) {
    consider(with_radius_near(dots, 0.5 * plate.diameter_mm * *scale), *plate.pitch_mm * *scale);
    if (best.lattice.dots.size() >= least_plate_dots) return best;
  }
  std::vector<double> radii;
  for (const detection::Dot& dot : dots) radii.push_back(dot.radius_px);
  std::sort(radii.begin(), radii.end());
  for (const double q : {0.2, 0.5, 0.8})
    if (!radii.empty())
      consider(with_radius_near(dots, radii[static_cast<std::size_t>(q * double(radii.size() - 1))]),
               std::nullopt);
  return best;
}

}  // namespace helicarm::rectification
