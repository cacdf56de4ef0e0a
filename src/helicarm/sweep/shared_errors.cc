// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/shared_errors.h"

#include <algorithm>
#include <utility>

#include "helicarm/calibration/view_problem.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/pipeline/prior.h"

namespace helicarm::sweep {

std::vector<Eigen::Matrix3Xd> phantom_errors(const phantom::Calibrator& calibrator) {
  const calibration::CommonPrior common = pipeline::common_prior(calibrator);
  const calibration::OffsetRoots roots = calibration::offset_roots(common);
  const Eigen::Vector3d centre = phantom::middle_of(calibrator);
  const auto n = Eigen::Index(calibrator.balls.size());
  const Eigen::Index own = roots.of_ball.empty() ? 0 : roots.joint ? roots.of_ball.front().cols() : 3 * n;
  std::vector<Eigen::Matrix3Xd> errors;
  for (Eigen::Index k = 0; k < n; ++k) {
    Eigen::Matrix3Xd& of_ball = errors.emplace_back(Eigen::Matrix3Xd::Zero(3, own + 1));
    if (own > 0 && roots.joint) of_ball.leftCols(own) = roots.of_ball[std::size_t(k)];
    if (own > 0 && !roots.joint)
      of_ball.middleCols(3 * k, roots.of_ball[std::size_t(k)].cols()) = roots.of_ball[std::size_t(k)];
    of_ball.col(own) = common.scale_sigma * (calibrator.balls[std::size_t(k)].centre_in_calibrator - centre);
  }
  return errors;
}

SharedMap::SharedMap(const rectification::DistortionMap& map, double noise_factor)
    : map_(map), factor_(noise_factor) {
  constexpr int side = 9;
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column) {
      const Eigen::Vector2d share((column + 0.5) / side, (row + 0.5) / side);
      const Eigen::Vector2d position = map.hull_low + share.cwiseProduct(map.hull_high - map.hull_low);
      if (rectification::raw_in_image(map, position)) grid_.push_back(position);
    }
  if (grid_.empty()) return;
  constexpr double least_share = 1e-3;
  const auto [values, vectors] = geometry::symmetric_eigen(map.covariance_px2(grid_));
  const auto n = values.size();
  const auto kept = (values.array() > std::max(0.0, least_share * values[n - 1])).count();
  modes_ = vectors.rightCols(kept) * values.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal();
}

Eigen::MatrixXd SharedMap::errors_at(const std::vector<Eigen::Vector2d>& pixels) const {
  std::vector<Eigen::Vector2d> places = pixels;
  places.insert(places.end(), grid_.begin(), grid_.end());
  const auto n = std::ssize(pixels), grid = std::ssize(grid_);
  return factor_ * map_.covariance_px2(places).topRightCorner(n, grid) * modes_;
}

std::optional<SharedMap> shared_map_of(const std::vector<FrameEstimate>& estimates, double noise_factor) {
  std::vector<const rectification::DistortionMap*> maps;
  for (const FrameEstimate& estimate : estimates)
    if (!estimate.failure && estimate.map) maps.push_back(&*estimate.map);
  if (maps.empty()) return {};
  SharedMap shared(*maps[maps.size() / 2], noise_factor);
  return shared.empty() ? std::nullopt : std::optional(std::move(shared));
}

}  // namespace helicarm::sweep
