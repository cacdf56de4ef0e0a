// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/rectification/models/kriging.h"
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
  for (const Eigen::Vector2d& at : {Eigen::Vector2d(0, 0), Eigen::Vector2d(100, 200), map->hull_high}) {
    const auto rectified = map->rectified_from_raw(at);
    check(!rectified || rectified->allFinite(), "a rectified position is finite");
    (void)rectification::raw_in_image(*map, at);
    check(!(map->sigma_px(at) < 0), "a standard deviation is not negative");
    (void)map->covariance_px2(std::vector{at, map->hull_high});
  }
}

std::vector<std::string> seeds() {
  const rectification::Normalisation normalised{{511.5, 511.5}, 512};
  Eigen::MatrixX2d cubic = Eigen::MatrixX2d::Zero(10, 2);
  cubic.topRows(3) << 511.5, 511.5, 512, 0, 0, 512;
  Eigen::MatrixX2d knotted = Eigen::MatrixX2d::Random(13, 2);
  knotted.topRows(10) = cubic;
  const auto seed = [](rectification::ModelPointer model) {
    rectification::DistortionMap map = rectification::identity_map(1024, 1024, 0.3);
    map.model = std::move(model);
    return write(map).dump();
  };
  const Eigen::MatrixXd covariance = 1e-4 * Eigen::MatrixXd::Identity(13, 13);
  Json radial = Json::parse(seed(rectification::polynomial_model(1, normalised, cubic.topRows(5))));
  for (const char* key : {"order", "kernel", "kernel_length", "kernel_sigma_px", "knots", "weights"})
    radial.erase(key);
  radial["kind"] = "radial";
  radial["axis"] = {0.1, 0.2};
  return {write(rectification::identity_map(64, 48, {})).dump(),
          seed(rectification::polynomial_model(3, normalised, cubic)),
          seed(std::make_shared<rectification::KrigingModel>(rectification::Trend{
              3, {normalised, knotted, covariance}, Eigen::MatrixX2d::Random(3, 2), 0.5, 1})),
          radial.dump()};
}

}  // namespace helicarm::fuzz
