// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/find_target.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "helicarm/detection/dot.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/detection/robust.h"
#include "helicarm/fiducials/centre_offset.h"
#include "helicarm/fiducials/solid_template.h"

namespace helicarm::fiducials {
namespace {

using Eigen::Vector2d;

constexpr double max_shift_px = 8;
constexpr double template_floor_px = 0.06;  // model error of a template on a smooth background

constexpr double max_log_size = 0.25;  // of a ball in the image from the file's diameter

/// Parameters: cubic background, contrast, shift, logarithm of a ball's size over the template's.
constexpr int n_background = 10;
constexpr int n_parameters = n_background + 4;
constexpr int at_shift = n_background + 1;
constexpr int at_size = n_background + 3;
using TargetVector = Eigen::Matrix<double, n_parameters, 1>;
using TargetNormal = Eigen::Matrix<double, n_parameters, n_parameters>;

/// raw -> rectified in a small patch: biquadratic interpolation of 3 x 3 exact points.
class LocalInverse {
 public:
  static std::optional<LocalInverse> make(const rectification::DistortionMap& map, const Vector2d& raw,
                                          double half) {
    LocalInverse inverse(raw, half);
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) {
        const auto uv = map.rectified_from_raw(raw + half * Vector2d(i - 1, j - 1));
        if (!uv) return std::nullopt;
        inverse.nodes_[3 * static_cast<std::size_t>(j) + static_cast<std::size_t>(i)] = *uv;
      }
    return inverse;
  }
  Vector2d operator()(const Vector2d& raw) const {
    const Vector2d t = (raw - middle_) / half_;
    const auto basis = [](double x) { return std::array{0.5 * x * (x - 1), 1 - x * x, 0.5 * x * (x + 1)}; };
    const auto bx = basis(t.x());
    const auto by = basis(t.y());
    Vector2d sum = Vector2d::Zero();
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t i = 0; i < 3; ++i) sum += by[j] * bx[i] * nodes_[3 * j + i];
    return sum;
  }

 private:
  LocalInverse(const Vector2d& middle, double half) : middle_(middle), half_(half) {}
  Vector2d middle_;
  double half_;
  std::array<Vector2d, 9> nodes_;
};

struct Fit {
  Vector2d shift = Vector2d::Zero();
  double contrast = 0;
  double sigma_px = 0;
  double noise = 0;
  double misfit = 0;
};

/// The pixels around a target, one column each.
struct Patch {
  std::vector<Vector2d> offsets;  ///< rectified, from the predicted image of the target's point
  std::vector<float> grey;        ///< over `scale`
  std::vector<float> weights;
  std::vector<int> cells;     ///< index in the patch's grid of raw pixels
  detection::PixelRows rows;  ///< the model's derivatives, then the residuals
  double scale;
  double window;
  int side;
  detection::NoiseCorrelation noise;
  bool sized;  ///< the size is fitted: a calibrator's scale and diameters are known to some percent only
};

struct Sums {
  TargetNormal normal;
  TargetVector right;
  double squares;
  double weight;
};

/// Derivatives and residuals at the given parameters.
void evaluate(Patch& patch, const SolidTemplate& absorbed, const TargetVector& p) {
  const Vector2d shift = p.segment<2>(at_shift);
  const double size = std::exp(p[at_size]);
  const auto contrast = static_cast<float>(p[n_background]);
  const auto row = [&](int k) { return patch.rows.row(k).data(); };
  float* by_contrast = row(n_background);
  float* by_u = row(at_shift);
  float* by_v = row(at_shift + 1);
  float* by_size = row(at_size);
  float* residual = row(n_parameters);
  for (std::size_t i = 0; i < patch.offsets.size(); ++i) {
    const Vector2d in_template = (patch.offsets[i] - shift) / size;
    const auto [value, slope] = absorbed.at(in_template);
    by_contrast[i] = -static_cast<float>(value);
    by_u[i] = contrast * static_cast<float>(slope.x() / size);
    by_v[i] = contrast * static_cast<float>(slope.y() / size);
    by_size[i] = patch.sized ? contrast * static_cast<float>(slope.dot(in_template)) : 0;
    residual[i] = patch.grey[i] - contrast * by_contrast[i];
  }
  patch.rows.row(n_parameters) -=
      p.head<n_background>().cast<float>().transpose() * patch.rows.topRows<n_background>();
}

Sums accumulate(const Patch& patch, std::span<const float> weights) {
  Eigen::MatrixXd products = detection::weighted_products(patch.rows, weights);
  if (!patch.sized) products(at_size, at_size) = 1;
  return {products.topLeftCorner<n_parameters, n_parameters>(),
          products.col(n_parameters).head<n_parameters>(), products(n_parameters, n_parameters),
          products(0, 0)};
}

/// Delete-a-group jackknife of the shift over the patch's sectors, one Gauss-Newton step each. It includes
/// model errors on one side of the target, such as an edge of the body, which the noise does not.
double jackknife_variance(const Patch& patch, const TargetVector& p) {
  constexpr int sectors = 8;
  std::vector<int> sector(patch.offsets.size());
  for (std::size_t i = 0; i < sector.size(); ++i) {
    const Vector2d from = patch.offsets[i] - p.segment<2>(at_shift);
    const double turn = std::atan2(from.y(), from.x()) / (2 * std::numbers::pi) + 0.5;
    sector[i] = static_cast<int>(std::min(sectors - 1.0, sectors * turn));
  }
  Vector2d sum = Vector2d::Zero();
  double squares = 0;
  for (int k = 0; k < sectors; ++k) {
    std::vector<float> rest = patch.weights;
    for (std::size_t i = 0; i < rest.size(); ++i)
      if (sector[i] == k) rest[i] = 0;
    const Sums sums = accumulate(patch, rest);
    const TargetVector step = sums.normal.ldlt().solve(sums.right);
    sum += step.segment<2>(at_shift);
    squares += step.segment<2>(at_shift).squaredNorm();
  }
  return 0.5 * (sectors - 1.0) / sectors * (squares - sum.squaredNorm() / sectors);
}

std::optional<Fit> fit_template(Patch patch, const SolidTemplate& absorbed) {
  TargetVector p = TargetVector::Zero();
  evaluate(patch, absorbed, p);
  Sums sums = accumulate(patch, patch.weights);
  constexpr int linear = n_background + 1;
  const Eigen::Matrix<double, linear, 1> start =
      sums.normal.topLeftCorner<linear, linear>().ldlt().solve(sums.right.head<linear>());
  if (!start.allFinite()) return std::nullopt;
  p.head<linear>() = start;
  const std::span residuals(patch.rows.row(n_parameters).data(), patch.offsets.size());
  double move = 0;
  double damping = 1;
  Vector2d before = Vector2d::Zero();
  for (int i = 0; i < 20; ++i) {
    evaluate(patch, absorbed, p);
    const float cut = detection::tukey_cut<float>(
        residuals, float(std::max(0.03, 0.3 * std::pow(0.5, i)) * std::abs(p[n_background])));
    for (std::size_t k = 0; k < residuals.size(); ++k)
      patch.weights[k] = detection::tukey_weight(residuals[k], cut);
    sums = accumulate(patch, patch.weights);
    TargetVector step = sums.normal.ldlt().solve(sums.right);
    if (!step.allFinite()) return std::nullopt;
    // The template is not smooth: a step that reverses the one before it is damped.
    if (step.segment<2>(at_shift).dot(before) < 0) damping *= 0.5;
    before = step.segment<2>(at_shift);
    step.segment<2>(at_shift) *= damping * std::min(1.0, 2 / std::max(1e-9, before.norm()));
    step[at_size] = std::clamp(step[at_size], -max_log_size / 5, max_log_size / 5);
    move = step.segment<2>(at_shift).norm();
    p += step;
    if (p.segment<2>(at_shift).norm() > max_shift_px || std::abs(p[at_size]) > max_log_size)
      return std::nullopt;
    if (i >= 5 && move < 2e-3) break;
  }
  if (move > 0.05) return std::nullopt;
  evaluate(patch, absorbed, p);
  sums = accumulate(patch, patch.weights);
  const double variance = sums.squares / std::max(1.0, sums.weight - n_parameters);
  const TargetNormal inverse = sums.normal.ldlt().solve(TargetNormal::Identity());
  detection::PixelRows weighted = patch.rows.topRows<n_parameters>();
  weighted.array().rowwise() *=
      Eigen::Map<const Eigen::ArrayXf>(patch.weights.data(), Eigen::Index(patch.weights.size())).transpose();
  const TargetNormal covariance =
      inverse * detection::correlated_normal(patch.noise, weighted, patch.cells, patch.side) * inverse;
  Fit fit;
  fit.shift = p.segment<2>(at_shift);
  fit.contrast = p[n_background] * patch.scale;
  fit.sigma_px = std::sqrt(detection::prior_variance(
      0.5 * variance * (covariance(at_shift, at_shift) + covariance(at_shift + 1, at_shift + 1)),
      jackknife_variance(patch, p)));
  fit.noise = std::sqrt(variance) * patch.scale;
  fit.misfit = double(patch.rows.row(n_parameters).norm()) / std::sqrt(double(residuals.size())) /
               std::max(1e-9, std::abs(p[n_background]));
  return fit;
}

/// The pixels within a few pixels of the metal; the background model holds no farther.
Expected<Patch> gather(const xray::XrayImage& xray_image, const rectification::DistortionMap& map,
                       const Vector2d& centre, double half_width, const PathImage& view_image,
                       std::span<const detection::Disc> others, const detection::NoiseCorrelation& noise,
                       const phantom::CalibratorTarget& target) {
  const SolidTemplate near_metal(view_image, 1, 2.5);
  const auto not_seen = [&] {
    return fail(Reason::not_seen, fmt::format("check target \"{}\" lies outside the image", target.name));
  };
  const Vector2d raw = map.raw_from_rectified(centre);
  if (!raw.allFinite() || !xray_image.pixels.contains(static_cast<int>(raw.x()), static_cast<int>(raw.y())))
    return not_seen();
  const auto inverse = LocalInverse::make(map, raw, half_width);
  if (!inverse) return not_seen();
  const detection::DotFitOptions limits = detection::fit_options_for(xray_image);
  const int half = static_cast<int>(std::ceil(half_width));
  Patch patch{{}, {},         {},           {},    {},
              1,  half_width, 2 * half + 1, noise, target.kind == phantom::TargetKind::ball};
  const int u0 = static_cast<int>(std::lround(raw.x()));
  const int v0 = static_cast<int>(std::lround(raw.y()));
  int inside = 0;
  double sum = 0;
  for (int v = v0 - half; v <= v0 + half; ++v)
    for (int u = u0 - half; u <= u0 + half; ++u) {
      const Vector2d offset = (*inverse)(Vector2d(u, v)) - centre;
      if (offset.norm() > half_width || near_metal.at(offset).value < 0.01) continue;
      ++inside;
      if (!xray_image.pixels.contains(u, v)) continue;
      const float grey = xray_image.pixels(u, v);
      if (grey <= limits.floor || grey >= limits.ceiling) continue;
      const bool hidden = std::any_of(others.begin(), others.end(), [&](const detection::Disc& disc) {
        return (disc.centre - Vector2d(u, v)).squaredNorm() < disc.radius * disc.radius;
      });
      const int cell = (v - v0 + half) * patch.side + u - u0 + half;
      if (hidden) continue;
      patch.offsets.push_back(offset);
      patch.grey.push_back(grey);
      patch.cells.push_back(cell);
      sum += std::abs(double(grey));
    }
  const std::size_t count = patch.offsets.size();
  if (2 * count < static_cast<std::size_t>(inside) || count < 40) return not_seen();
  patch.scale = std::max(1e-3, sum / double(count));
  patch.weights.assign(count, 1);
  patch.rows.resize(n_parameters + 1, static_cast<Eigen::Index>(count));
  for (std::size_t i = 0; i < count; ++i) {
    patch.grey[i] /= float(patch.scale);
    const float x = float(patch.offsets[i].x() / half_width);
    const float y = float(patch.offsets[i].y() / half_width);
    patch.rows.col(static_cast<Eigen::Index>(i)).head<n_background>() << 1, x, y, x * x, x * y, y * y,
        x * x * x, x * x * y, x * y * y, y * y * y;
  }
  return patch;
}

}  // namespace

Expected<ImagePoint> find_target(const xray::XrayImage& xray_image, const rectification::DistortionMap& map,
                                 const geometry::View& view, const phantom::CalibratorTarget& target,
                                 std::span<const detection::Disc> others,
                                 const detection::NoiseCorrelation& noise) {
  const double depth = view.depth(target.point_in_calibrator);
  if (!(depth > 0))
    return fail(Reason::behind_source,
                fmt::format("check target \"{}\" lies behind the source", target.name));
  const double px_per_mm = std::abs(view.intrinsics.fy) / depth;
  const Vector2d centre = view.project(target.point_in_calibrator);
  // Long enough for the wire's direction, short of its far end (a wire of unknown length has at least
  // 10 mm).
  const double reach_mm = target.kind == phantom::TargetKind::ball ? 0.55 * target.diameter_mm
                          : target.kind == phantom::TargetKind::cross
                              ? 0.45 * (target.length_mm > 0 ? target.length_mm : 10)
                              : 2.5 * target.diameter_mm;
  const double half_width = reach_mm * px_per_mm + 2.5;
  const PathImage view_image = image_of_target(target, view, half_width + max_shift_px);
  const auto patch = gather(xray_image, map, centre, half_width, view_image, others, noise, target);
  if (!patch) return tl::unexpected<Failure>(patch.error());
  std::optional<Fit> best;
  const auto try_template = [&](double attenuation, double blur) {
    const auto fit = fit_template(*patch, SolidTemplate(view_image, attenuation, blur));
    const bool better = fit && (!best || fit->noise < best->noise);
    if (better) best = fit;
    return better;
  };
  try_template(0.25, 1.0);
  const double attenuation = try_template(0.7, 1.0) ? 0.7 : 0.25;
  if (try_template(attenuation, 0.7))
    try_template(attenuation, 0.5);
  else
    try_template(attenuation, 1.4);
  if (!best || std::abs(best->contrast) < 4 * best->noise || best->misfit > 0.4 || best->sigma_px > 1)
    return fail(Reason::target_not_found,
                fmt::format("check target \"{}\" is not visible at its predicted position", target.name));
  const Vector2d uv = centre + best->shift;
  const double map_sigma = map.sigma_px(uv);
  return ImagePoint{map.raw_from_rectified(uv), uv,
                    std::sqrt(best->sigma_px * best->sigma_px + map_sigma * map_sigma +
                              template_floor_px * template_floor_px)};
}

Expected<ImagePoint> point_of_click(const rectification::DistortionMap& map, const Vector2d& click_raw,
                                    std::optional<double> sigma_px) {
  if (!map.shows(click_raw))
    return fail(Reason::not_seen,
                fmt::format("pick ({:.1f}, {:.1f}) px lies outside the image of {} x {} pixels",
                            click_raw.x(), click_raw.y(), map.width, map.height),
                {{"u", click_raw.x()}, {"v", click_raw.y()}});
  const auto uv = rectification::rectified_in_image(map, click_raw);
  if (!uv)
    return fail(Reason::not_seen,
                fmt::format("pick ({:.1f}, {:.1f}) px: the distortion map cannot be inverted there",
                            click_raw.x(), click_raw.y()),
                {{"u", click_raw.x()}, {"v", click_raw.y()}});
  return ImagePoint{click_raw, *uv, std::hypot(sigma_px.value_or(click_sigma_px), map.sigma_px(*uv))};
}

Expected<ImagePoint> snap_to_ball(const xray::XrayImage& xray_image, const rectification::DistortionMap& map,
                                  const geometry::View& view, double depth_mm, const Vector2d& click_raw,
                                  double diameter_mm, const detection::NoiseCorrelation& noise) {
  detection::Dot start;
  start.radius_px = 0.5 * diameter_mm * std::abs(view.intrinsics.fy) / depth_mm;
  const double reach = std::max(5.0, start.radius_px);
  const detection::BallProfile profile(0.9 / start.radius_px, 3);
  detection::DotFitOptions options = detection::fit_options_for(xray_image);
  options.noise = noise;
  detection::DotFitOptions wide = options;
  wide.tolerance = 0.1;
  wide.margin_share = 0.35;
  wide.margin_px = 3.5;
  std::optional<detection::Dot> best;
  for (const double r : {0.0, 0.5})
    for (int k = 0; k < (r > 0 ? 6 : 1); ++k) {
      start.centre_px =
          click_raw + r * start.radius_px * Vector2d(std::cos(1.0472 * k), std::sin(1.0472 * k));
      const auto rough = detection::fit_dot(xray_image.pixels, start, profile, {}, wide);
      if (!rough || (rough->centre_px - click_raw).norm() > reach) continue;
      if (std::abs(rough->radius_px / start.radius_px - 1) > 0.3 || rough->misfit > 0.35) continue;
      const auto fine = detection::fit_dot(xray_image.pixels, *rough, profile, {}, options);
      const detection::Dot& dot = fine ? *fine : *rough;
      if (!best || dot.misfit < best->misfit) best = dot;
    }
  if (!best)
    return fail(Reason::target_not_found,
                fmt::format("no ball of {} mm diameter within {:.0f} px of the pick ({:.1f}, {:.1f})",
                            diameter_mm, reach, click_raw.x(), click_raw.y()));
  const auto rough_uv = map.rectified_from_raw(best->centre_px);
  if (!rough_uv) return fail(Reason::not_seen, "the pick lies outside the rectified field");
  const Vector2d raw = best->centre_px - blob_offset(map, view, *rough_uv, depth_mm, diameter_mm);
  const auto uv = map.rectified_from_raw(raw);
  if (!uv) return fail(Reason::not_seen, "the pick lies outside the rectified field");
  const double map_sigma = map.sigma_px(*uv);
  return ImagePoint{raw, *uv,
                    std::sqrt(best->error_px() * best->error_px() + map_sigma * map_sigma +
                              template_floor_px * template_floor_px)};
}

}  // namespace helicarm::fiducials
