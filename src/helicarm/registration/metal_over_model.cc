// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/metal_over_model.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/LU>

#include "helicarm/core/statistics.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector2d;

constexpr double metal_spacing_mm = 1;  // of the rays: screws are 2 to 7 mm wide
constexpr float least_outline = 1;      // mm of 1000 HU along a ray within the outline
constexpr int least_outline_rays = 200;
// Contrast from which something is metal. In modelled knees bones reached 0.8 over 20 mm and more, fiducials
// that lie in a row 1.1.
constexpr float least_contrast = 1.5F;
// Two fiducials of 8 mm that touch are up to 20 mm long. Where nothing excludes them, fiducials in a row had
// up to 54 mm^2, one wire of a calibrator 94, as a short screw has; a screw of 4 mm and 35 mm has 140.
constexpr double least_length_mm = 20, least_area_mm2 = 100;
constexpr float least_drop = 0.5F;  // of the contrast, within two rays at the metal's edge
constexpr double least_comparisons_share = 0.05;

/// Attenuation of the image, and that of the model along the same rays.
struct Overlay {
  Raster seen;
  image::Image<float> model;
  double spacing_mm = 0;  ///< at the depth of the model's centre

  int width() const { return model.width(); }
  int height() const { return model.height(); }
  bool is_shown(int u, int v) const { return model.contains(u, v) && seen.valid(u, v) != 0; }
  bool is_inside(int u, int v) const { return is_shown(u, v) && model(u, v) > least_outline; }
};

Overlay overlay_of(const Model& model, const RegistrationView& view, const Registration& found) {
  const double pixel_mm = view.view.depth(found.centre) / std::abs(view.view.intrinsics.fy);
  const int factor = std::max(1, int(std::lround(metal_spacing_mm / pixel_mm)));
  Overlay overlay{coarser(attenuation_raster(view), factor), {}, factor * pixel_mm};
  const image::Image<float>& seen = overlay.seen.attenuation;
  overlay.model = image::Image<float>(seen.width(), seen.height(), 0);
  const PosedDensity posed(model.density, found.world_from_model, view.view.source_in_world(), found.centre);
  const Eigen::Matrix3d world_from_pixel =
      view.view.camera_from_world.rotation.transpose() * view.view.intrinsics.matrix().inverse();
  const float hardening = model.density.hardening;
  for (int v = 0; v < seen.height(); ++v)
    for (int u = 0; u < seen.width(); ++u) {
      const Vector2d pixel = overlay.seen.pixel_at(Vector2d(u, v));
      const float value = posed.integrate((world_from_pixel * pixel.homogeneous()).normalized());
      overlay.model(u, v) = hardening > 0 ? (1 - std::exp(-hardening * value)) / hardening : value;
    }
  return overlay;
}

/// What a pixel's attenuation is in contrasts of the model's densest parts: 0 in the middle of what lies
/// within the outline, 1 as much above as the densest hundredth of the model is. The attenuation of the model
/// per that of the image is taken from the lower half of both: metal does not change it up to half the
/// outline, nor a wrong pose.
struct ContrastScale {
  float middle = 0, unit = 0;
  float at(float attenuation) const { return (attenuation - middle) / unit; }
};

std::optional<ContrastScale> contrast_scale(const Overlay& overlay) {
  std::vector<float> seen, model;
  for (int v = 0; v < overlay.height(); ++v)
    for (int u = 0; u < overlay.width(); ++u)
      if (overlay.is_inside(u, v)) {
        seen.push_back(overlay.seen.attenuation(u, v));
        model.push_back(overlay.model(u, v));
      }
  if (seen.size() < std::size_t(least_outline_rays)) return std::nullopt;
  const float middle = quantile(seen, 0.5), model_middle = quantile(model, 0.5);
  const float seen_spread = middle - quantile(seen, 0.25);
  const float model_spread = model_middle - quantile(model, 0.25);
  const float unit = seen_spread / model_spread * (quantile(model, 0.99) - model_middle);
  if (!(model_spread > 0 && unit > 0)) return std::nullopt;
  return ContrastScale{middle, unit};
}

using Piece = std::vector<std::pair<int, int>>;

/// Connected pixels above the least contrast.
std::vector<Piece> dense_pieces(const Overlay& overlay, const ContrastScale& scale) {
  image::Image<std::uint8_t> taken(overlay.width(), overlay.height(), 0);
  std::vector<Piece> pieces;
  const auto visit = [&](Piece& piece, int u, int v) {
    if (!overlay.is_shown(u, v) || taken(u, v)) return;
    if (scale.at(overlay.seen.attenuation(u, v)) < least_contrast) return;
    taken(u, v) = 1;
    piece.emplace_back(u, v);
  };
  for (int v = 0; v < overlay.height(); ++v)
    for (int u = 0; u < overlay.width(); ++u) {
      Piece piece;
      visit(piece, u, v);
      for (std::size_t i = 0; i < piece.size(); ++i) {
        const auto [x, y] = piece[i];
        for (int dv = -1; dv <= 1; ++dv)
          for (int du = -1; du <= 1; ++du) visit(piece, x + du, y + dv);
      }
      if (!piece.empty()) pieces.push_back(std::move(piece));
    }
  return pieces;
}

/// Largest extent along twelve directions, rays.
double length_of(const Piece& piece) {
  constexpr int directions = 12;
  double longest = 0;
  for (int i = 0; i < directions; ++i) {
    const double angle = EIGEN_PI * i / directions;
    double low = 1e9, high = -1e9;
    for (const auto& [u, v] : piece) {
      const double at = u * std::cos(angle) + v * std::sin(angle);
      low = std::min(low, at);
      high = std::max(high, at);
    }
    longest = std::max(longest, high - low + 1);
  }
  return longest;
}

/// Median fall of the contrast within two rays of a piece's edge pixels.
float drop_at_edge(const Overlay& overlay, const ContrastScale& scale, const Piece& piece) {
  constexpr int reach = 2;
  std::vector<float> drops;
  for (const auto& [u, v] : piece) {
    const float own = scale.at(overlay.seen.attenuation(u, v));
    float least = own;
    bool is_edge = false;
    for (int dv = -reach; dv <= reach; ++dv)
      for (int du = -reach; du <= reach; ++du) {
        if (!overlay.is_shown(u + du, v + dv)) continue;
        const float beside = scale.at(overlay.seen.attenuation(u + du, v + dv));
        least = std::min(least, beside);
        is_edge |= beside < least_contrast && std::abs(du) < reach && std::abs(dv) < reach;
      }
    if (is_edge) drops.push_back(own - least);
  }
  return drops.empty() ? 0 : median(std::move(drops));
}

/// Splits the comparisons by whether one of the pixels lies within a comparison's side of them.
void compare_agreements(const Raster& raster, const Piece& metal, const RegisteredView& registered,
                        MetalOverModel& result) {
  double on = 0, on_weight = 0, off = 0, off_weight = 0;
  for (const LocalAgreement& each : registered.agreements) {
    const bool is_near = std::ranges::any_of(metal, [&](const std::pair<int, int>& pixel) {
      const Vector2d apart = raster.pixel_at(Vector2d(pixel.first, pixel.second)) - each.pixel;
      return apart.cwiseAbs().maxCoeff() < registered.comparison_px;
    });
    (is_near ? on : off) += each.weight * each.agreement;
    (is_near ? on_weight : off_weight) += each.weight;
  }
  if (on_weight > 0) result.agreement = on / on_weight;
  if (off_weight > 0) result.agreement_elsewhere = off / off_weight;
  if (on_weight + off_weight > 0) result.comparisons_share = on_weight / (on_weight + off_weight);
}

}  // namespace

std::optional<MetalOverModel> metal_over_model(const Model& model, const RegistrationView& view,
                                               const RegisteredView& registered, const Registration& found) {
  if (model.surface || !(view.view.depth(found.centre) > 1)) return std::nullopt;
  const Overlay overlay = overlay_of(model, view, found);
  const auto scale = contrast_scale(overlay);
  if (!scale) return std::nullopt;
  MetalOverModel result;
  Piece metal;
  const double pixel_mm2 = overlay.spacing_mm * overlay.spacing_mm;
  for (const Piece& piece : dense_pieces(overlay, *scale)) {
    const double length = length_of(piece) * overlay.spacing_mm;
    const double area = pixel_mm2 * double(std::ranges::count_if(piece, [&](const std::pair<int, int>& at) {
                          return overlay.is_inside(at.first, at.second);
                        }));
    if (length < least_length_mm || area < least_area_mm2) continue;
    if (drop_at_edge(overlay, *scale, piece) < least_drop) continue;
    result.length_mm = std::max(result.length_mm, length);
    result.area_mm2 += area;
    for (const auto& [u, v] : piece)
      result.contrast = std::max(result.contrast, double(scale->at(overlay.seen.attenuation(u, v))));
    metal.insert(metal.end(), piece.begin(), piece.end());
  }
  if (metal.empty()) return std::nullopt;
  compare_agreements(overlay.seen, metal, registered, result);
  return result.comparisons_share < least_comparisons_share ? std::nullopt : std::optional(result);
}

}  // namespace helicarm::registration
