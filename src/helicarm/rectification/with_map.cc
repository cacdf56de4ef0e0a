// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/detection/find_dots.h"
#include "helicarm/rectification/rectify.h"
#include "helicarm/rectification/seen_lattice.h"
#include "helicarm/rectification/usable.h"

namespace helicarm::rectification {
namespace {

using phantom::DotKind;
using phantom::Lattice;

/// Without a plate description a plate may still be present: more dots than a calibrator's balls and some
/// outliers can form.
constexpr std::size_t least_dots_of_any_plate = 20;
constexpr double any_diameter_mm = 2.5;
constexpr double largest_radius_searched_from_px = 4.5;  // leaves out the search's first octave

/// The lattices that may be in the image, by the dots' kind: the plate's, or any of a plate that is not
/// described.
std::vector<phantom::Plate> plates_of(const std::optional<phantom::Plate>& plate, DotKind kind) {
  if (plate) return plate->kind == kind ? std::vector{*plate} : std::vector<phantom::Plate>{};
  return {{"", kind, Lattice::square, {}, any_diameter_mm, {}, {}},
          {"", kind, Lattice::hexagonal, {}, any_diameter_mm, {}, {}}};
}

/// A plate in the image.
struct SeenPlate {
  SeenLattice seen;
  Lattice kind;
};

/// Holes are bright, as noise and trabeculae are: they are a plate if most dots of their size lie on the
/// lattice.
constexpr double least_share_of_holes = 0.6;

/// The largest lattice of the dots; nothing if it is too small to be a plate.
std::optional<SeenPlate> plate_among(const std::vector<detection::Dot>& dots,
                                     const xray::XrayImage& xray_image,
                                     const std::vector<phantom::Plate>& plates, std::size_t least) {
  std::optional<SeenPlate> largest;
  for (const phantom::Plate& plate : plates) {
    const auto scale = plate.pitch_mm ? expected_scale(xray_image, plate) : std::nullopt;
    SeenPlate found{seen_lattice(dots, plate, scale), plate.lattice};
    const std::size_t most = largest ? largest->seen.lattice.dots.size() : least - 1;
    const double share =
        double(found.seen.lattice.dots.size()) / double(std::max<std::size_t>(1, found.seen.dots.size()));
    if (plate.kind == DotKind::holes && share < least_share_of_holes) continue;
    if (found.seen.lattice.dots.size() > most) largest = std::move(found);
  }
  return largest;
}

/// Distance (px rms) of the rectified dots from a lattice, i.e. from an affine image of it.
std::optional<double> bend_px(const SeenPlate& plate, const DistortionMap& map) {
  std::vector<Correspondence> dots;
  for (const IndexedDot& d : plate.seen.lattice.dots) {
    const detection::Dot& dot = plate.seen.dots[d.dot];
    if (const auto uv = map.rectified_from_raw(dot.centre_px))
      dots.push_back({lattice_point(d.index, plate.kind), *uv, dot.error_px()});
  }
  MapOptions straight;
  straight.order = 1;
  const auto fit = fit_map(dots, map.width, map.height, straight);
  return fit ? std::optional(fit->map.residual_rms_px) : std::nullopt;
}

/// What an own map of these dots leaves, each predicted from the others, and 30 % or five standard deviations
/// of a root mean square more: a map of another pose exceeds it.
double bend_limit_px(const SeenPlate& plate, const DistortionMap& map) {
  std::vector<Correspondence> dots;
  for (const IndexedDot& d : plate.seen.lattice.dots) {
    const detection::Dot& dot = plate.seen.dots[d.dot];
    dots.push_back({lattice_point(d.index, plate.kind), dot.centre_px, dot.error_px()});
  }
  const auto own = fit_map(dots, map.width, map.height, {});
  if (!own) return std::max(0.5, 3 * map.held_out_rms_px);
  const double left = std::max(own->map.held_out_rms_px, map.held_out_rms_px);
  return std::max(0.1, left * std::max(1.3, 1 + 5 / std::sqrt(2 * double(dots.size()))));
}

/// The distortion by a map that was not made of this image's dots, over the ellipse in their box.
void state_distortion(Rectification& of_image) {
  const DistortionMap& map = of_image.map;
  if (map.is_identity()) return;
  constexpr int steps = 12;  // from the middle to the edge
  const Eigen::Vector2d middle = 0.5 * (map.hull_low + map.hull_high), half = map.hull_high - middle;
  int count = 0;
  for (int i = -steps; i <= steps; ++i)
    for (int j = -steps; j <= steps; ++j) {
      const Eigen::Vector2d along = Eigen::Vector2d(i, j) / steps, at = middle + half.cwiseProduct(along);
      if (along.norm() > 1) continue;
      const double shift_px = (map.raw_from_rectified(at) - at).norm();
      of_image.raw_mean_px += shift_px;
      of_image.raw_max_px = std::max(of_image.raw_max_px, shift_px);
      ++count;
    }
  of_image.raw_mean_px /= count;
}

}  // namespace

double least_checked_radius_px(const xray::XrayImage& xray_image,
                               const std::optional<phantom::Plate>& plate) {
  const double least = detection::DotOptions{}.min_radius_px;
  const phantom::Plate sought = plate.value_or(plates_of({}, DotKind::balls).front());
  const auto scale = expected_scale(xray_image, sought);
  return std::clamp(scale ? 0.4 * sought.diameter_mm * *scale : least, least,
                    largest_radius_searched_from_px);
}

Expected<Rectification> with_map(const xray::XrayImage& xray_image, const DistortionMap& map,
                                 const std::optional<phantom::Plate>& plate) {
  auto dots = detection::unsearched(xray_image, least_checked_radius_px(xray_image, plate));
  return with_map(xray_image, dots, map, plate);
}

Expected<Rectification> with_map(const xray::XrayImage& xray_image, detection::ImageDots& dots,
                                 const DistortionMap& map, const std::optional<phantom::Plate>& plate) {
  if (map.width != xray_image.pixels.width() || map.height != xray_image.pixels.height())
    return fail(Reason::plate_mismatch,
                fmt::format("the map is for {} x {} pixels, the image has {} x {}", map.width, map.height,
                            xray_image.pixels.width(), xray_image.pixels.height()));
  if (auto usable = check_usable(xray_image); !usable) return tl::unexpected<Failure>(usable.error());
  Rectification result;
  result.map = map;
  state_distortion(result);
  const auto possible_dots = [&](detection::Polarity polarity) {
    return detection::from_radius(detection::dots_of(dots, xray_image, polarity),
                                  least_checked_radius_px(xray_image, plate));
  };
  // A plate in the image verifies the map: rectified, its dots must form a lattice.
  const std::size_t least = plate ? least_plate_dots : least_dots_of_any_plate;
  const auto balls =
      plate_among(possible_dots(result.metal), xray_image, plates_of(plate, DotKind::balls), least);
  auto seen = balls;
  if (const auto holes = plates_of(plate, DotKind::holes); !seen && !holes.empty())
    seen = plate_among(possible_dots(detection::opposite(result.metal)), xray_image, holes, least);
  if (!seen) return result;
  const auto bend = bend_px(*seen, map);
  const double limit = bend_limit_px(*seen, map);
  if (bend && *bend > limit)
    return fail(
        Reason::plate_mismatch,
        fmt::format(
            "{} the plate in the image: its rectified dots are {:.2f} px rms off a lattice, limit {:.2f}",
            map.is_identity() ? "there is no map, but distortion bends" : "the map does not fit", *bend,
            limit),
        {{"residual_rms_px", *bend}});
  result.map_confirmed = bend.has_value();
  if (!balls) return result;
  for (const IndexedDot& d : balls->seen.lattice.dots)
    result.confirming_dots.push_back(balls->seen.dots[d.dot]);
  return result;
}

}  // namespace helicarm::rectification
