// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/distortion_map.h"
#include "json_target.h"

namespace helicarm::fuzz {
namespace {

Json write(const rectification::DistortionMap& map) { return to_json(map); }
Expected<rectification::DistortionMap> read(const Json& json) {
  return rectification::distortion_map_from_json(json, "map.json");
}

}  // namespace

void run(std::string_view bytes) {
  run_round_trip(bytes, read, write);
  const auto json = parse_json(bytes, "map.json");
  if (!json) return;
  const auto map = read(*json);
  if (!map) return;
  for (const Eigen::Vector2d& at : {Eigen::Vector2d(0, 0), Eigen::Vector2d(100, 200), map->centre}) {
    const auto rectified = map->rectified_from_raw(at);
    check(!rectified || rectified->allFinite(), "a rectified position is finite");
    (void)rectification::raw_in_image(*map, at);
    check(!(map->sigma_px(at) < 0), "a standard deviation is not negative");
    (void)map->covariance_px2(std::vector{at, map->centre});
  }
}

std::vector<std::string> seeds() {
  rectification::DistortionMap cubic = rectification::identity_map(1024, 1024, 0.3);
  cubic.model = "kriging";
  cubic.order = 3;
  cubic.centre = {511.5, 511.5};
  cubic.scale = 512;
  cubic.coefficients = Eigen::MatrixX2d::Zero(10, 2);
  cubic.coefficients.row(0) = cubic.centre.transpose();
  cubic.coefficients(1, 0) = cubic.coefficients(2, 1) = 512;
  rectification::DistortionMap knotted = cubic;
  knotted.knots = Eigen::MatrixX2d::Random(3, 2);
  knotted.weights = Eigen::MatrixX2d::Random(3, 2);
  knotted.kernel_length = 0.5;
  knotted.kernel_sigma_px = 1;
  knotted.coefficient_covariance = 1e-4 * Eigen::MatrixXd::Identity(13, 13);
  return {write(rectification::identity_map(64, 48, {})).dump(), write(cubic).dump(), write(knotted).dump()};
}

}  // namespace helicarm::fuzz
