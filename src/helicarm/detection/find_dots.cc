// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/find_dots.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "helicarm/geometry/near_points.h"

namespace helicarm::detection {
namespace {

/// The noise of a linear image grows with the root of the signal, so the search runs on the root; a
/// logarithmic image is used as is.
image::Image<float> even_noise(const xray::XrayImage& xray_image) {
  image::Image<float> even = xray_image.pixels;
  if (!xray_image.acquisition.logarithmic.value_or(false))
    for (float& grey : even.pixels()) grey = std::sqrt(std::max(0.0f, grey - xray_image.lowest));
  return even;
}

std::vector<Eigen::Vector2d> centres_of(const std::vector<Dot>& dots) {
  std::vector<Eigen::Vector2d> centres;
  for (const Dot& dot : dots) centres.push_back(dot.centre_px);
  return centres;
}

double largest_radius(const std::vector<Dot>& dots) {
  double largest = 0;
  for (const Dot& dot : dots) largest = std::max(largest, dot.radius_px);
  return largest;
}

/// Of overlapping duplicates only the best is kept.
std::vector<Dot> without_doubles(std::vector<Dot> dots) {
  std::ranges::stable_sort(dots, {}, &Dot::misfit);
  const double reach = 0.6 * largest_radius(dots);
  const geometry::NearPoints near(centres_of(dots), reach);
  std::vector<bool> is_kept(dots.size(), false);
  std::vector<Dot> kept;
  for (std::size_t i = 0; i < dots.size(); ++i) {
    is_kept[i] = true;
    near.visit(dots[i].centre_px, reach, [&](std::size_t j, double squared) {
      if (j < i && is_kept[j] && std::sqrt(squared) < 0.6 * std::max(dots[i].radius_px, dots[j].radius_px))
        is_kept[i] = false;
    });
    if (is_kept[i]) kept.push_back(dots[i]);
  }
  return kept;
}

constexpr double beside_radii = 2.5, beside_px = 12;  // from a dot's centre to the rim of one beside it

std::vector<Disc> discs_beside(const Dot& dot, const std::vector<Dot>& dots) {
  std::vector<Disc> discs;
  for (const Dot& other : dots) {
    const double distance = (other.centre_px - dot.centre_px).norm();
    if (distance > 0.5 * dot.radius_px &&
        distance < beside_radii * dot.radius_px + beside_px + other.radius_px)
      discs.push_back({other.centre_px, other.radius_px + 1.5});
  }
  return discs;
}

/// Fits with the neighbours masked, or jointly with those that overlap, whichever gives the smaller centre
/// error.
std::optional<Dot> refit(const xray::XrayImage& xray_image, const Dot& dot, const DotAppearance& appearance,
                         const std::vector<Dot>& neighbours) {
  auto best =
      fit_dot(xray_image.pixels, dot, appearance.profile, discs_beside(dot, neighbours), appearance.options);
  std::vector<Dot> group{dot};
  std::vector<Dot> others;
  for (const Dot& other : neighbours) {
    const double distance = (other.centre_px - dot.centre_px).norm();
    if (distance <= 0.5 * dot.radius_px) continue;  // the dot itself
    (distance < dot.radius_px + other.radius_px + 1.5 ? group : others).push_back(other);
  }
  if (group.size() == 1 || group.size() > max_dots_together) return best;
  std::vector<BallProfile> profiles;
  std::vector<Disc> discs;
  for (const Dot& member : group) {
    const double ratio = member.radius_px / dot.radius_px;  // same metal and blur
    profiles.emplace_back(appearance.profile.blur() / ratio, appearance.profile.absorbance() * ratio);
    const auto beside = discs_beside(member, others);
    discs.insert(discs.end(), beside.begin(), beside.end());
  }
  const auto together = fit_dots_together(xray_image.pixels, group, profiles, discs, appearance.options);
  if (together && (!best || together->front().sigma_px < best->sigma_px)) best = together->front();
  return best;
}

}  // namespace

DotFitOptions fit_options_for(const xray::XrayImage& xray_image) {
  DotFitOptions options;
  options.floor = xray_image.lowest + 0.002f * (xray_image.highest - xray_image.lowest);
  options.ceiling = xray_image.highest;
  return options;
}

NoiseCorrelation noise_correlation(const xray::XrayImage& xray_image) {
  const DotFitOptions limits = fit_options_for(xray_image);
  return noise_correlation(xray_image, limits.floor, limits.ceiling);
}

DotAppearance estimate_appearance(const xray::XrayImage& xray_image, const NoiseCorrelation& noise,
                                  std::vector<Dot> dots) {
  constexpr std::size_t sample = 8;
  std::stable_sort(dots.begin(), dots.end(),
                   [](const Dot& a, const Dot& b) { return a.sigma_px < b.sigma_px; });
  if (dots.size() > sample) dots.resize(sample);
  const double radius = dots.empty() ? 5.0 : dots[dots.size() / 2].radius_px;
  DotFitOptions options = fit_options_for(xray_image);
  options.rough = 0.1;  // the dots are already fitted
  double blur = 1;
  double absorbance = 2;
  const auto total = [&] {
    const BallProfile profile(blur / radius, absorbance);
    double sum = 0;
    for (const Dot& dot : dots) {
      const auto fitted = fit_dot(xray_image.pixels, dot, profile, {}, options);
      sum += fitted ? fitted->sigma_px : 1.0;
    }
    return sum;
  };
  double best = total();
  const auto try_values = [&](double& value, auto next, double low, double high) {
    for (const double direction : {1.0, -1.0}) {
      bool better = false;
      while (true) {
        const double before = value;
        value = next(value, direction);
        const double now = value >= low && value <= high ? total() : best;
        if (now >= best) {
          value = before;
          break;
        }
        best = now;
        better = true;
      }
      if (better) return;
    }
  };
  for (const double factor : {1.5, 1.2}) {
    const auto scaled = [&](double x, double d) { return x * std::pow(factor, d); };
    const auto scaled_twice = [&](double x, double d) { return x * std::pow(factor * factor, d); };
    try_values(blur, scaled, 0.3, 0.6 * radius + 0.3);
    try_values(absorbance, scaled_twice, 0.1, 60);
  }
  options.noise = noise;
  return {BallProfile(blur / radius, absorbance), options};
}

std::vector<Dot> find_dots(const xray::XrayImage& xray_image, const DotOptions& options) {
  BlobOptions blob_options;
  blob_options.polarity = options.polarity;
  blob_options.min_radius_px = options.min_radius_px;
  blob_options.max_radius_px = options.max_radius_px;
  const std::vector<Dot> blobs = find_blobs(even_noise(xray_image), blob_options);
  DotFitOptions fit = fit_options_for(xray_image);
  fit.tolerance = 0.1;  // profile and centre are only approximate here
  fit.margin_share = 0.35;
  fit.margin_px = 3.5;
  const double least_contrast = options.min_contrast_share * double(xray_image.highest - xray_image.lowest);
  std::vector<BallProfile> profiles;  // per octave of the radius: the blur is about a pixel at any size
  for (double radius = 1.5; radius < 2 * options.max_radius_px; radius *= 1.5)
    profiles.emplace_back(1 / radius, 2.0);
  std::vector<Dot> dots;
  for (const Dot& blob : blobs) {
    const auto octave =
        static_cast<std::size_t>(std::max(0.0, std::round(std::log(blob.radius_px / 1.5) / std::log(1.5))));
    const auto dot =
        fit_dot(xray_image.pixels, blob, profiles[std::min(octave, profiles.size() - 1)], {}, fit);
    if (!dot || dot->sigma_px > options.max_sigma_px || dot->misfit > options.max_misfit) continue;
    if (dot->radius_px < fit_reach * options.min_radius_px || dot->radius_px > 1.2 * options.max_radius_px)
      continue;
    const double contrast = options.polarity == Polarity::dark ? dot->contrast : -dot->contrast;
    if (contrast < least_contrast) continue;
    if ((dot->centre_px - blob.centre_px).norm() > 0.8 * blob.radius_px + 1) continue;
    dots.push_back(*dot);
  }
  return without_doubles(std::move(dots));
}

std::vector<Dot> find_clear_dots(const xray::XrayImage& xray_image, const DotOptions& options,
                                 double clear_sigma_px) {
  constexpr double same_size = 1.15;
  std::vector<Dot> found = find_dots(xray_image, options);
  const NoiseCorrelation noise = noise_correlation(xray_image);
  std::stable_sort(found.begin(), found.end(),
                   [](const Dot& a, const Dot& b) { return a.radius_px < b.radius_px; });
  std::vector<Dot> clear;
  for (auto first = found.begin(); first != found.end();) {
    const auto last = std::find_if(
        first, found.end(), [&](const Dot& dot) { return dot.radius_px > same_size * first->radius_px; });
    const std::vector<Dot> size(first, last);
    for (const Dot& dot : refit_dots(xray_image, size, estimate_appearance(xray_image, noise, size), found))
      if (dot.sigma_px < clear_sigma_px && dot.misfit < options.max_misfit) clear.push_back(dot);
    first = last;
  }
  return clear;
}

std::vector<std::optional<Dot>> refit_each(const xray::XrayImage& xray_image, const std::vector<Dot>& dots,
                                           const DotAppearance& appearance,
                                           const std::vector<Dot>& neighbours) {
  // Of a group that is fitted together, those beside each member count.
  const double reach =
      2 * ((beside_radii + 1) * std::max(largest_radius(dots), largest_radius(neighbours)) + beside_px);
  const geometry::NearPoints near(centres_of(neighbours), reach);
  std::vector<std::optional<Dot>> refitted;
  for (const Dot& dot : dots) {
    std::vector<Dot> beside;
    for (const std::size_t i : near.within(dot.centre_px, reach)) beside.push_back(neighbours[i]);
    refitted.push_back(refit(xray_image, dot, appearance, beside));
  }
  return refitted;
}

std::vector<Dot> refit_dots(const xray::XrayImage& xray_image, const std::vector<Dot>& dots,
                            const DotAppearance& appearance, const std::vector<Dot>& neighbours) {
  std::vector<Dot> refitted;
  for (const auto& dot : refit_each(xray_image, dots, appearance, neighbours))
    if (dot) refitted.push_back(*dot);
  return refitted;
}

std::vector<Dot> dots_except(const std::vector<Dot>& dots, const std::vector<Dot>& taken) {
  std::vector<Dot> rest;
  std::ranges::copy_if(dots, std::back_inserter(rest), [&](const Dot& dot) {
    return std::ranges::none_of(taken, [&](const Dot& other) {
      return (dot.centre_px - other.centre_px).norm() < 0.7 * std::max(dot.radius_px, other.radius_px);
    });
  });
  return rest;
}

}  // namespace helicarm::detection
