// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/calibrator.h"
#include "json_target.h"

namespace helicarm::fuzz {
namespace {

Json write(const phantom::Calibrator& calibrator) { return to_json(calibrator); }

}  // namespace

void run(std::string_view bytes) {
  const auto json = parse_json(bytes, "calibrator.json");
  if (!json) return;
  const auto calibrator = phantom::calibrator_from_json(*json, "calibrator.json");
  if (!calibrator) return;
  const Json written = write(*calibrator);
  check(all_finite(written) && calibrator->balls.size() >= 6, "a calibrator has balls at finite positions");
  for (const phantom::CalibratorTarget& target : calibrator->targets)
    for (const auto& direction : target.directions)
      check(std::abs(direction.norm() - 1) < 1e-9, "directions have unit length");
  const auto again = phantom::calibrator_from_json(written, "written.json");
  check(again.has_value() && phantom::same_places(*again, *calibrator), "written data read back equal");
  check(phantom::joint_ball_covariance(*calibrator).allFinite(), "a joint covariance is finite");
}

std::vector<std::string> seeds() {
  phantom::Calibrator full = phantom::udcsc();
  full.tolerance_mm = 0.02;
  full.targets = {{"T1", {1, 2, 3}, phantom::TargetKind::ball, 3, {}},
                  {"T2",
                   {4, 5, 6},
                   phantom::TargetKind::cross,
                   1,
                   {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY()},
                   20},
                  {"T3", {7, 8, 9}, phantom::TargetKind::line_end, 1, {Eigen::Vector3d::UnitZ()}}};
  phantom::Calibrator measured = phantom::udcsc();
  measured.balls.resize(6);
  measured.scale_sigma = 1e-3;
  measured.joint_covariance.emplace();
  measured.joint_covariance->mm2 = 1e-4 * Eigen::MatrixXd::Identity(18, 18);
  for (phantom::CalibratorBall& ball : measured.balls) {
    ball.covariance_mm2 = 1e-4 * Eigen::Matrix3d::Identity();
    measured.joint_covariance->labels.push_back(ball.label);
  }
  return {write(phantom::udcsc()).dump(), write(full).dump(), write(measured).dump()};
}

}  // namespace helicarm::fuzz
