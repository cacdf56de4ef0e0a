// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/marker_image.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace helicarm::track {
namespace {

using detection::Dot;

constexpr std::array blurs{0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.85, 1.1};
constexpr double least_radius_px = 1.3;  // of the disc and ring that are compared
constexpr double overlap_px = 4.5;       // beyond two radii: the fit's ring of background holds the neighbour
constexpr double same_px = 0.8;          // two fits of one disc

/// Offsets of a disc and of the ring around it.
struct Rings {
  std::vector<Eigen::Vector2i> disc, ring;
  int reach = 0;
};

Rings rings_of(double radius_px) {
  const double radius = std::max(radius_px, least_radius_px);
  const double inner = radius + 1.5, outer = radius + 3.2;
  Rings rings;
  rings.reach = int(std::ceil(outer));
  for (int v = -rings.reach; v <= rings.reach; ++v)
    for (int u = -rings.reach; u <= rings.reach; ++u) {
      const double distance = std::hypot(u, v);
      if (distance <= 0.8 * radius) rings.disc.emplace_back(u, v);
      if (distance >= inner && distance <= outer) rings.ring.emplace_back(u, v);
    }
  return rings;
}

/// Mean of the ring less that of the disc.
float response_at(const image::Image<float>& grey, const Rings& rings, int u, int v) {
  float disc = 0, ring = 0;
  int in_disc = 0, in_ring = 0;
  if (grey.contains(u - rings.reach, v - rings.reach) && grey.contains(u + rings.reach, v + rings.reach)) {
    for (const Eigen::Vector2i& at : rings.disc) disc += grey(u + at.x(), v + at.y());
    for (const Eigen::Vector2i& at : rings.ring) ring += grey(u + at.x(), v + at.y());
    return ring / float(rings.ring.size()) - disc / float(rings.disc.size());
  }
  for (const Eigen::Vector2i& at : rings.disc)
    if (grey.contains(u + at.x(), v + at.y())) disc += grey(u + at.x(), v + at.y()), ++in_disc;
  for (const Eigen::Vector2i& at : rings.ring)
    if (grey.contains(u + at.x(), v + at.y())) ring += grey(u + at.x(), v + at.y()), ++in_ring;
  return in_disc && 2 * in_ring > int(rings.ring.size()) ? ring / float(in_ring) - disc / float(in_disc) : 0;
}

/// The response to a disc of contrast 1.
float response_to(const detection::BallProfile& profile, double radius_px) {
  const Rings rings = rings_of(radius_px);
  const auto mean = [&](const std::vector<Eigen::Vector2i>& offsets) {
    float sum = 0;
    for (const Eigen::Vector2i& at : offsets)
      sum += profile.at(float(at.cast<double>().norm() / radius_px)).value;
    return sum / float(offsets.size());
  };
  return mean(rings.disc) - mean(rings.ring);
}

struct Peak {
  Eigen::Vector2d at;
  float response;
};

std::vector<Peak> peaks_in(const image::Image<float>& grey, const Eigen::Vector2d& centre, double reach_px,
                           double radius_px, double polarity) {
  const Rings rings = rings_of(radius_px);
  const int u0 = int(std::lround(centre.x())), v0 = int(std::lround(centre.y()));
  const int reach = int(std::ceil(reach_px)) + 1;
  const int side = 2 * reach + 1;
  std::vector<float> response(std::size_t(side * side), 0);
  const auto at = [&](int i, int j) -> float& { return response[std::size_t(j * side + i)]; };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i)
      if (grey.contains(u0 + i - reach, v0 + j - reach))
        at(i, j) = float(polarity) * response_at(grey, rings, u0 + i - reach, v0 + j - reach);
  std::vector<Peak> peaks;
  for (int j = 1; j + 1 < side; ++j)
    for (int i = 1; i + 1 < side; ++i) {
      const float here = at(i, j);
      if (!(here > 0)) continue;
      bool is_peak = true;
      for (int dj = -1; dj <= 1 && is_peak; ++dj)
        for (int di = -1; di <= 1 && is_peak; ++di) {
          const float there = at(i + di, j + dj);
          // Of equal neighbours the first counts.
          is_peak =
              (di == 0 && dj == 0) || there < here || (there == here && (dj > 0 || (dj == 0 && di > 0)));
        }
      if (is_peak) peaks.push_back({Eigen::Vector2d(u0 + i - reach, v0 + j - reach), here});
    }
  std::ranges::sort(peaks, std::greater<>(), &Peak::response);
  return peaks;
}

/// Mean grey level of the ring around a disc.
double ring_level(const image::Image<float>& grey, const Eigen::Vector2d& at, double radius_px) {
  const int u = int(std::lround(at.x())), v = int(std::lround(at.y()));
  double sum = 0;
  int count = 0;
  for (const Eigen::Vector2i& off : rings_of(radius_px).ring)
    if (grey.contains(u + off.x(), v + off.y())) sum += double(grey(u + off.x(), v + off.y())), ++count;
  return count > 0 ? sum / count : 0;
}

MarkerImage marker_from(const image::Image<float>& grey, const Dot& dot) {
  return {dot.centre_px, dot.error_px(), dot.radius_px, dot.contrast,
          ring_level(grey, dot.centre_px, dot.radius_px)};
}

Dot start_at(const Eigen::Vector2d& at, double radius_px) {
  Dot start;
  start.centre_px = at;
  start.radius_px = radius_px;
  return start;
}

/// The fit at a peak; discs of up to thrice the size are fitted too, as neighbours.
std::optional<MarkerImage> fitted_at(const image::Image<float>& grey, const Eigen::Vector2d& at,
                                     double radius_px, const MarkerAppearance& appearance,
                                     double* misfit = nullptr) {
  for (const double size : {1.0, 1.8}) {
    const auto dot =
        detection::fit_dot(grey, start_at(at, size * radius_px), appearance.profile, {}, appearance.options);
    if (!dot || dot->contrast * appearance.polarity <= 0 || (dot->centre_px - at).norm() > radius_px + 1)
      continue;
    if (misfit) *misfit = dot->misfit;
    return marker_from(grey, *dot);
  }
  return std::nullopt;
}

/// Fits each disc together with its neighbours. Faint texture beside it is none: a joint fit would wander.
void fit_overlapping(const image::Image<float>& grey, std::vector<MarkerImage>& found,
                     const MarkerAppearance& appearance) {
  constexpr double least_contrast = 0.3, vague = 0.12, farthest_px = 1;
  const std::vector<MarkerImage> alone = found;
  for (std::size_t i = 0; i < found.size(); ++i) {
    std::vector<std::pair<double, std::size_t>> near;
    for (std::size_t k = 0; k < alone.size(); ++k) {
      const double distance = (alone[k].uv_raw - alone[i].uv_raw).norm();
      if (k != i && distance < alone[i].radius_px + alone[k].radius_px + overlap_px &&
          std::abs(alone[k].contrast) > least_contrast * std::abs(alone[i].contrast) &&
          alone[k].sigma_px < vague * alone[k].radius_px)
        near.emplace_back(distance, k);
    }
    if (near.empty()) continue;
    std::ranges::sort(near);
    if (near.size() > detection::max_dots_together - 1) near.resize(detection::max_dots_together - 1);
    std::vector<Dot> starts{start_at(alone[i].uv_raw, alone[i].radius_px)};
    for (const auto& [distance, k] : near) starts.push_back(start_at(alone[k].uv_raw, alone[k].radius_px));
    const std::vector<detection::BallProfile> profiles(starts.size(), appearance.profile);
    const auto together = detection::fit_dots_together(grey, starts, profiles, {}, appearance.options);
    if (!together || together->front().contrast * appearance.polarity <= 0) continue;
    const MarkerImage joint = marker_from(grey, together->front());
    if ((joint.uv_raw - alone[i].uv_raw).norm() < farthest_px && has_marker_size(joint, alone[i].radius_px) &&
        joint.sigma_px < 3 * alone[i].sigma_px)
      found[i] = joint;
  }
}

}  // namespace

std::span<const double> profile_blurs() { return blurs; }

bool has_marker_size(const MarkerImage& image, double radius_px) {
  constexpr double smallest = 0.55, largest = 1.7;
  return image.radius_px > smallest * radius_px && image.radius_px < largest * radius_px;
}

std::optional<PickedMarker> picked_marker(const xray::XrayImage& image, const Eigen::Vector2d& at,
                                          double radius_px, double reach_px,
                                          const MarkerAppearance& appearance) {
  constexpr float least_share = 0.4F;  // of the strongest response in the window
  constexpr std::size_t most_peaks = 5;
  constexpr double largest_misfit = 0.3;
  std::optional<PickedMarker> best;
  const auto peaks = peaks_in(image.pixels, at, reach_px, radius_px, appearance.polarity);
  for (std::size_t i = 0; i < std::min(peaks.size(), most_peaks); ++i) {
    if (peaks[i].response < least_share * peaks[0].response) break;
    double misfit = 0;
    const auto fitted = fitted_at(image.pixels, peaks[i].at, radius_px, appearance, &misfit);
    if (!fitted || !has_marker_size(*fitted, radius_px) || misfit > largest_misfit ||
        fitted->sigma_px > 0.3 * radius_px)
      continue;
    const double distance = (fitted->uv_raw - at).norm();
    if (distance > reach_px) continue;
    if (!best || distance < (best->image.uv_raw - at).norm()) best = PickedMarker{*fitted, misfit};
  }
  return best;
}

std::vector<MarkerImage> find_markers(const xray::XrayImage& image, std::span<const SearchWindow> windows,
                                      const MarkerAppearance& appearance) {
  constexpr float least_share =
      0.1F;  // the expected response is that of the stated radius, the fit's is smaller
  constexpr std::size_t most_peaks = 12;
  std::vector<MarkerImage> found;
  const auto add = [&](const MarkerImage& marker) {
    for (MarkerImage& other : found)
      if ((other.uv_raw - marker.uv_raw).norm() < same_px) {
        if (marker.sigma_px < other.sigma_px) other = marker;
        return;
      }
    found.push_back(marker);
  };
  for (const SearchWindow& window : windows) {
    const auto peaks =
        peaks_in(image.pixels, window.centre, window.reach_px, window.radius_px, appearance.polarity);
    const float weakest =
        least_share * float(window.contrast) * response_to(appearance.profile, window.radius_px);
    for (std::size_t i = 0; i < std::min(peaks.size(), most_peaks); ++i) {
      if (peaks[i].response < weakest) break;
      if (const auto fitted = fitted_at(image.pixels, peaks[i].at, window.radius_px, appearance))
        add(*fitted);
    }
  }
  fit_overlapping(image.pixels, found, appearance);
  // Two markers seen as one disc.
  for (std::size_t i = 0; i < windows.size(); ++i)
    for (std::size_t k = i + 1; k < windows.size(); ++k) {
      const double distance = (windows[i].centre - windows[k].centre).norm();
      const double radius = std::max(windows[i].radius_px, windows[k].radius_px);
      if (distance > 2 * radius || distance < 0.3 * radius) continue;
      const Eigen::Vector2d middle = (windows[i].centre + windows[k].centre) / 2;
      const auto near = std::ranges::count_if(
          found, [&](const MarkerImage& disc) { return (disc.uv_raw - middle).norm() < 2 * radius; });
      if (near >= 2) continue;
      const std::array starts{start_at(windows[i].centre, windows[i].radius_px),
                              start_at(windows[k].centre, windows[k].radius_px)};
      const std::array profiles{appearance.profile, appearance.profile};
      detection::DotFitOptions options = appearance.options;
      options.free_radius = false;
      const auto both = detection::fit_dots_together(image.pixels, starts, profiles, {}, options);
      if (!both) continue;
      for (const Dot& dot : *both)
        if (dot.contrast * appearance.polarity > 0) found.push_back(marker_from(image.pixels, dot));
    }
  return found;
}

}  // namespace helicarm::track
