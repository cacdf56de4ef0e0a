// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/rectify.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "helicarm/detection/find_dots.h"
#include "helicarm/image/opencv.h"
#include "helicarm/rectification/paper_dots.h"
#include "helicarm/rectification/plate_match.h"
#include "helicarm/rectification/seen_lattice.h"
#include "helicarm/rectification/usable.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;

constexpr double pitch_tolerance = 0.04;  // measured relative to expected pitch

/// Refits the lattice's dots with their own profile and their neighbours masked.
detection::DotAppearance refit_lattice_dots(const xray::XrayImage& xray_image,
                                            const detection::NoiseCorrelation& noise,
                                            const std::vector<detection::Dot>& all, SeenLattice& seen) {
  std::vector<detection::Dot> members;
  for (const IndexedDot& d : seen.lattice.dots) members.push_back(seen.dots[d.dot]);
  const detection::DotAppearance appearance = detection::estimate_appearance(xray_image, noise, members);
  const auto refitted =
      detection::refit_each(xray_image, members, appearance, all.size() > 500 ? members : all);
  for (std::size_t i = 0; i < members.size(); ++i)
    if (refitted[i] && (refitted[i]->centre_px - members[i].centre_px).norm() < members[i].radius_px)
      seen.dots[seen.lattice.dots[i].dot] = *refitted[i];
  return appearance;
}

Expected<void> check_pitch(const IndexedLattice& lattice, const phantom::Plate& plate,
                           std::optional<double> scale, const MapFit& fit) {
  if (!scale || !plate.pitch_mm) return {};
  const double ratio = fit.px_per_mm / *scale;
  if (std::abs(ratio - 1) <= pitch_tolerance) return {};
  return fail(
      Reason::plate_mismatch,
      fmt::format("the plate in the image has a pitch of {:.2f} mm, \"{}\" has {} mm (tolerance {:.0f} %)",
                  *plate.pitch_mm * ratio, plate.name, *plate.pitch_mm, 100 * pitch_tolerance),
      {{"pitch_px", lattice.pitch_px}, {"pitch_mm", *plate.pitch_mm * ratio}});
}

void set_metric(DistortionMap& map, const xray::XrayImage& xray_image, const phantom::Plate& plate,
                double px_per_mm) {
  if (!plate.pitch_mm) return;
  map.rectified_pixel_mm = 1 / px_per_mm;
  map.rectified_plane = RectifiedPlane::plate;
  const auto& distance = xray_image.acquisition.source_detector_mm;
  if (!distance || !plate.height_above_receiver_mm) return;
  *map.rectified_pixel_mm *= *distance / (*distance - *plate.height_above_receiver_mm);
  map.rectified_plane = RectifiedPlane::detector;
}

/// Places of the plate that no dot was seen at and that may lie in the image.
std::vector<Vector2d> places_missed(const phantom::Plate& plate, const std::vector<Correspondence>& seen,
                                    const MapFit& fit, const xray::XrayImage& xray_image) {
  std::set<std::pair<double, double>> known;
  for (const Correspondence& c : seen) known.emplace(c.place_mm.x(), c.place_mm.y());
  const Vector2d size(xray_image.pixels.width(), xray_image.pixels.height());
  const Vector2d margin = 0.25 * size;  // no intensifier displaces by more
  std::vector<Vector2d> missed;
  for (const Vector2d& place : plate.dots_mm) {
    const Vector2d rectified = fit.rectified_from_plate * place;
    if (known.contains({place.x(), place.y()}) || (rectified + margin).minCoeff() < 0 ||
        (size + margin - rectified).minCoeff() < 0)
      continue;
    missed.push_back(place);
  }
  return missed;
}

/// Fits plate dots that the search missed at the positions predicted by the map.
void fit_missing_dots(const xray::XrayImage& xray_image, const phantom::Plate& plate, const MapFit& fit,
                      const detection::DotAppearance& appearance, const std::vector<detection::Dot>& all,
                      std::vector<detection::Dot>& plate_dots, std::vector<Correspondence>& seen) {
  if (plate.dots_mm.empty() || plate_dots.empty()) return;
  double radius = 0;
  for (const detection::Dot& dot : plate_dots) radius += dot.radius_px / double(plate_dots.size());
  const double contrast = plate_dots[plate_dots.size() / 2].contrast;
  const bool is_bright = plate_dots[0].contrast > 0;
  const std::vector<Vector2d> places = places_missed(plate, seen, fit, xray_image);
  std::vector<detection::Dot> starts(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    starts[i].centre_px = fit.map.raw_from_rectified(fit.rectified_from_plate * places[i]);
    starts[i].radius_px = radius;
  }
  const auto fitted = detection::refit_each(xray_image, starts, appearance, all);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto& dot = fitted[i];
    if (!dot || dot->sigma_px > 0.2 || dot->misfit > 0.3) continue;
    if ((dot->contrast > 0) != is_bright || std::abs(dot->contrast) < 0.3 * std::abs(contrast)) continue;
    if ((dot->centre_px - starts[i].centre_px).norm() > 1.5 || std::abs(dot->radius_px / radius - 1) > 0.15)
      continue;
    seen.push_back({places[i], dot->centre_px, dot->error_px()});
    plate_dots.push_back(*dot);
  }
}

/// Dots that may be the plate's.
std::vector<detection::Dot> possible_dots(const xray::XrayImage& xray_image, detection::ImageDots& dots,
                                          const phantom::Plate& plate, detection::Polarity polarity,
                                          Method method, std::optional<double> scale) {
  if (method == Method::best)
    return detection::from_radius(detection::dots_of(dots, xray_image, polarity),
                                  least_dot_radius_px(xray_image, plate));
  const double radius = scale ? 0.5 * plate.diameter_mm * *scale : 0.0055 * xray_image.pixels.width();
  return find_dots_paper(xray_image.pixels, xray_image.lowest, xray_image.highest, 0.7 * radius,
                         1.35 * radius);
}

struct Attempt {
  detection::Polarity polarity;
  std::vector<detection::Dot> all;
  SeenLattice seen;
  std::size_t size() const { return seen.lattice.dots.size(); }
};

/// Metal is dark and holes are bright, unless the whole image is inverted.
Attempt find_lattice(const xray::XrayImage& xray_image, detection::ImageDots& dots,
                     const phantom::Plate& plate, Method method, std::optional<double> scale) {
  const auto attempt = [&](detection::Polarity polarity) {
    Attempt now{polarity, possible_dots(xray_image, dots, plate, polarity, method, scale), {}};
    now.seen = seen_lattice(now.all, plate, scale);
    return now;
  };
  const detection::Polarity expected =
      plate.kind == phantom::DotKind::balls ? detection::Polarity::dark : detection::Polarity::bright;
  Attempt first = attempt(expected);
  if (first.size() >= least_plate_dots) return first;
  Attempt second = attempt(detection::opposite(expected));
  return second.size() > first.size() ? second : first;
}

/// Why the plate's lattice was not found: there is none, or one of the other kind.
Failure without_lattice(const xray::XrayImage& xray_image, detection::ImageDots& dots, phantom::Plate plate,
                        Method method, std::optional<double> scale, std::size_t found) {
  const bool square = plate.lattice == phantom::Lattice::square;
  plate.lattice = square ? phantom::Lattice::hexagonal : phantom::Lattice::square;
  const std::size_t of_other_kind = find_lattice(xray_image, dots, plate, method, scale).size();
  if (of_other_kind >= least_plate_dots)
    return {
        Reason::plate_mismatch,
        fmt::format("{} dots form a {} lattice, that of \"{}\" is {}: name the plate that was used, such as "
                    "a plate.json with \"lattice\": \"{}\"",
                    of_other_kind, square ? "hexagonal" : "square", plate.name,
                    square ? "square" : "hexagonal", square ? "hexagonal" : "square"),
        {},
        {{"dots_found", double(of_other_kind)}}};
  return {Reason::plate_not_found,
          fmt::format("only {} dots form a lattice like that of \"{}\", at least {} are needed", found,
                      plate.name, least_plate_dots),
          {},
          {{"dots_found", double(found)}}};
}

}  // namespace

double least_dot_radius_px(const xray::XrayImage& xray_image, const phantom::Plate& plate) {
  constexpr double smaller = 0.75;  // than the file's
  const double least = detection::DotOptions{}.min_radius_px;
  const auto scale = expected_scale(xray_image, plate);
  return scale ? std::max(least, smaller * 0.5 * plate.diameter_mm * *scale) : least;
}

Expected<Rectification> rectify(const xray::XrayImage& xray_image, const phantom::Plate& plate,
                                const RectificationOptions& options) {
  auto dots = detection::unsearched(xray_image, least_dot_radius_px(xray_image, plate));
  return rectify(xray_image, dots, plate, options);
}

Expected<Rectification> rectify(const xray::XrayImage& xray_image, detection::ImageDots& image_dots,
                                const phantom::Plate& plate, const RectificationOptions& options) {
  if (auto usable = check_usable(xray_image); !usable) return tl::unexpected<Failure>(usable.error());
  const auto scale = expected_scale(xray_image, plate);
  const int width = xray_image.pixels.width();
  const int height = xray_image.pixels.height();
  Attempt attempt = find_lattice(xray_image, image_dots, plate, options.method, scale);
  if (attempt.size() < least_plate_dots)
    return tl::unexpected<Failure>(
        without_lattice(xray_image, image_dots, plate, options.method, scale, attempt.size()));

  std::optional<detection::DotAppearance> appearance;
  if (options.method == Method::best)
    appearance = refit_lattice_dots(xray_image, image_dots.noise, attempt.all, attempt.seen);
  const Vector2d middle(0.5 * (width - 1), 0.5 * (height - 1));
  const auto matched = match_plate(attempt.seen.lattice, attempt.seen.dots, plate, middle);
  if (!matched) return tl::unexpected<Failure>(matched.error());

  std::vector<detection::Dot> dots;
  std::vector<Correspondence> seen;
  for (const PlateDot& d : *matched) {
    const detection::Dot& dot = attempt.seen.dots[d.dot];
    dots.push_back(dot);
    seen.push_back({d.place_mm, dot.centre_px, dot.error_px()});
  }
  MapOptions map_options;
  map_options.order = options.method == Method::paper ? std::optional(2) : options.order;
  if (options.method == Method::best) map_options.model = options.model;
  map_options.reject_outliers = true;
  auto fit = fit_map(seen, width, height, map_options);
  if (!fit) return tl::unexpected<Failure>(fit.error());
  if (auto pitch = check_pitch(attempt.seen.lattice, plate, scale, *fit); !pitch)
    return tl::unexpected<Failure>(pitch.error());
  if (appearance && dots.size() < plate.dots_mm.size()) {
    const std::size_t found = dots.size();
    fit_missing_dots(xray_image, plate, *fit, *appearance, attempt.all, dots, seen);
    auto again = dots.size() > found ? fit_map(seen, width, height, map_options) : fit;
    if (again) fit = std::move(again);
  }

  Rectification result;
  result.map = fit->map;
  set_metric(result.map, xray_image, plate, fit->px_per_mm);
  for (std::size_t i = 0; i < dots.size(); ++i) {
    if (!fit->used[i]) continue;
    result.plate_dots.push_back(dots[i]);
    result.residual_px.push_back(fit->residual_px[i]);
    const double shift =
        (seen[i].raw_px -
         fit->map.rectified_from_raw(seen[i].raw_px).value_or(fit->rectified_from_plate * seen[i].place_mm))
            .norm();
    result.raw_mean_px += shift;
    result.raw_max_px = std::max(result.raw_max_px, shift);
  }
  result.dots_found = static_cast<int>(result.plate_dots.size());
  result.raw_mean_px /= std::max(1, result.dots_found);
  if (!plate.dots_mm.empty()) result.dots_expected = static_cast<int>(plate.dots_mm.size());
  result.metal =
      plate.kind == phantom::DotKind::balls ? attempt.polarity : detection::opposite(attempt.polarity);
  return result;
}

DistortionMap flat_panel_map(const xray::XrayImage& xray_image) {
  const auto& pixel = xray_image.acquisition.pixel_mm;
  return identity_map(xray_image.pixels.width(), xray_image.pixels.height(),
                      pixel ? std::optional(std::sqrt(pixel->x() * pixel->y())) : std::nullopt);
}

image::Image<float> resample(const xray::XrayImage& xray_image, const DistortionMap& map) {
  if (map.is_identity()) return xray_image.pixels;
  // The map is smooth: exact at every 8th pixel, bilinear in between.
  constexpr int step = 8;
  const int width = xray_image.pixels.width();
  const int height = xray_image.pixels.height();
  cv::Mat coarse((height - 1) / step + 2, (width - 1) / step + 2, CV_32FC2);
  for (int j = 0; j < coarse.rows; ++j)
    for (int i = 0; i < coarse.cols; ++i) {
      const Vector2d raw = map.raw_from_rectified(Vector2d(i * step, j * step));
      coarse.at<cv::Vec2f>(j, i) = {float(raw.x()), float(raw.y())};
    }
  image::Image<float> rectified(width, height);
  // In strips: the places of all pixels take twice the memory of the image.
  constexpr int strip = 32 * step;
  cv::Mat places;
  for (int top = 0; top < height; top += strip) {
    const int rows = std::min(strip, height - top);
    const cv::Matx23f enlarge(1.f / step, 0, 0, 0, 1.f / step, float(top) / step);
    cv::warpAffine(coarse, places, enlarge, {width, rows}, cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                   cv::BORDER_REPLICATE);
    cv::Mat target = image::as_mat(rectified).rowRange(top, top + rows);
    cv::remap(image::as_mat(xray_image.pixels), target, places, {}, cv::INTER_LINEAR, cv::BORDER_CONSTANT,
              double(xray_image.lowest));
  }
  return rectified;
}

}  // namespace helicarm::rectification
