// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/distortion_model.h"

#include <algorithm>
#include <array>

#include <Eigen/LU>

namespace helicarm::rectification {

// One line for each model. models/NAME.cc defines `ModelKind NAME_kind()`. Of models that suit the same
// number of dots the simpler one comes first.
#define HELICARM_DISTORTION_MODELS(model) model(polynomial) model(radial) model(kriging)

#define HELICARM_DECLARE(NAME) ModelKind NAME##_kind();
HELICARM_DISTORTION_MODELS(HELICARM_DECLARE)
#undef HELICARM_DECLARE

std::span<const ModelKind> model_kinds() {
#define HELICARM_CALL(NAME) NAME##_kind(),
  static const std::array kinds{HELICARM_DISTORTION_MODELS(HELICARM_CALL)};
#undef HELICARM_CALL
  return kinds;
}

const ModelKind* model_kind(std::string_view name) {
  const auto kinds = model_kinds();
  const auto kind = std::find_if(kinds.begin(), kinds.end(), [&](const auto& k) { return k.name == name; });
  return kind == kinds.end() ? nullptr : &*kind;
}

std::string model_names() {
  std::string names;
  for (const ModelKind& kind : model_kinds()) names += (names.empty() ? "" : ", ") + std::string(kind.name);
  return names;
}

bool clearly_better(const ModelFit& fit, const ModelFit& than) {
  return fit.model && (!than.model || fit.held_out_rms < 0.98 * than.held_out_rms);
}

ModelFit automatic_fit(const PlateDots& dots) {
  Eigen::Index from = 0;
  for (const ModelKind& kind : model_kinds())
    if (kind.automatic_from_dots <= dots.raw.rows()) from = std::max(from, kind.automatic_from_dots);
  ModelFit best;
  for (const ModelKind& kind : model_kinds()) {
    if (kind.automatic_from_dots != from) continue;
    ModelFit fit = kind.fit(dots, {});
    if (clearly_better(fit, best)) best = std::move(fit);
  }
  return best;
}

std::optional<Eigen::Vector2d> DistortionModel::rectified_from_raw(const Eigen::Vector2d& raw) const {
  const double extent = extent_px();
  Eigen::Vector2d rectified = raw;
  for (int i = 0; i < 30; ++i) {
    const Eigen::Matrix2d slope = jacobian(rectified);
    if (!(slope.determinant() > 0.05)) return std::nullopt;
    const Eigen::Vector2d step = slope.inverse() * (raw - raw_from_rectified(rectified));
    rectified += step;
    if (!rectified.allFinite() || (rectified - raw).norm() > extent) return std::nullopt;
    if (step.norm() < 1e-11 * extent) return rectified;
  }
  return std::nullopt;
}

Eigen::MatrixXd DistortionModel::covariance_px2(std::span<const Eigen::Vector2d> rectified) const {
  const auto n = static_cast<Eigen::Index>(rectified.size());
  return Eigen::MatrixXd::Zero(n, n);
}

}  // namespace helicarm::rectification
