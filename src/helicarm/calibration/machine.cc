// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/machine.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace helicarm {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double believed_shots = 4;
constexpr int rounds = 50;
constexpr double least_information = 1e-9;  // 1 / mm^2
constexpr std::size_t most_shots = 10000;

Vector3d squares(double focal, double principal) {
  return {focal * focal, principal * principal, principal * principal};
}

double variance(double first, double observed, double n) {
  return (believed_shots * first * first + observed) / (believed_shots + n);
}

Json row(const Vector3d& v) { return Json::array({v.x(), v.y(), v.z()}); }

MachineShot shot_from(JsonReader& reader) {
  const auto estimate = reader.numbers("estimate_mm", 3, {-1e4, 1e4});
  const auto information = reader.matrix("information_per_mm2", 3, 3, {-1e12, 1e12});
  MachineShot shot{reader.text("picture"), reader.text("view"), Vector3d(estimate.data()),
                   Matrix3d(information.data())};
  reader.finish();
  const double lowest = Eigen::SelfAdjointEigenSolver<Matrix3d>(shot.information).eigenvalues().minCoeff();
  if (!(lowest > 0) || !shot.information.isApprox(shot.information.transpose(), 1e-9))
    reader.refuse(Reason::bad_value, "information_per_mm2", "is not symmetric and positive");
  return shot;
}

}  // namespace

MachineKnowledge knowledge_of(std::span<const MachineShot> shots, const Vector3d& nominal_mm,
                              const MachinePrior& unknown) {
  MachineKnowledge known{nominal_mm, unknown};
  if (shots.empty()) return known;
  const double n = double(shots.size());
  const Matrix3d believed =
      squares(unknown.focal->common, unknown.principal->common).cwiseInverse().asDiagonal();
  for (int round = 0; round < rounds; ++round) {
    const Vector3d sag = squares(known.prior.focal->of_view, known.prior.principal->of_view);
    Matrix3d information = believed;
    Vector3d pull = believed * nominal_mm;
    for (const MachineShot& shot : shots) {
      const Matrix3d of_mean = (shot.information.inverse() + Matrix3d(sag.asDiagonal())).inverse();
      information += of_mean;
      pull += of_mean * shot.estimate_mm;
    }
    const Matrix3d covariance = information.inverse();
    known.mean_mm = covariance * pull;
    Vector3d observed = Vector3d::Zero();
    for (const MachineShot& shot : shots) {
      const Matrix3d posterior = (shot.information + Matrix3d(sag.cwiseInverse().asDiagonal())).inverse();
      const Matrix3d gain = posterior * shot.information;
      const Vector3d departure = gain * (shot.estimate_mm - known.mean_mm);
      observed += (posterior + gain * covariance * gain.transpose()).diagonal() + departure.cwiseAbs2();
    }
    known.prior.focal = {std::sqrt(covariance(0, 0)),
                         std::sqrt(variance(unknown.focal->of_view, observed(0), n))};
    known.prior.principal = {
        std::sqrt((covariance(1, 1) + covariance(2, 2)) / 2),
        std::sqrt(variance(unknown.principal->of_view, (observed(1) + observed(2)) / 2, n))};
  }
  return known;
}

std::optional<MachineShot> shot_of(const ViewFiducials& view, const std::string& picture,
                                   const CommonPrior& unknown) {
  if (!view.prior.focal_px || !view.prior.principal_px) return std::nullopt;
  CalibrationOptions options;
  options.common = unknown;
  options.rejection_probability = 0;  // the false balls are out already
  const auto alone = calibrate({view}, options);
  if (!alone) return std::nullopt;
  const CalibratedView& calibrated = alone->views[0];
  const Intrinsics& k = calibrated.view.intrinsics;
  const double hand = k.fx < 0 ? -1 : 1;
  Eigen::Matrix<double, 3, 4> in_mm;
  in_mm << 0.5 * hand, 0.5, 0, 0, 0, 0, hand, 0, 0, 0, 0, 1;
  in_mm /= view.prior.unit_px;
  const Vector3d nominal(*view.prior.focal_px / view.prior.unit_px, 0, 0);
  const Vector3d posterior = in_mm * Eigen::Vector4d(k.fx, k.fy, k.u0 - view.prior.principal_px->x(),
                                                     k.v0 - view.prior.principal_px->y());
  const Matrix3d information =
      (in_mm * calibrated.covariance.topLeftCorner<4, 4>() * in_mm.transpose()).inverse();
  const auto variance_of = [](const Departure& d) { return std::hypot(d.common, d.of_view); };
  const Matrix3d believed =
      squares(variance_of(*unknown.machine.focal), variance_of(*unknown.machine.principal))
          .cwiseInverse()
          .asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> told(information - believed);
  const Matrix3d own = told.eigenvectors() * told.eigenvalues().cwiseMax(least_information).asDiagonal() *
                       told.eigenvectors().transpose();
  // posterior = own^-1-weighted mean of the estimate and the nominal values.
  const Vector3d estimate = posterior + own.ldlt().solve(believed * (posterior - nominal));
  return MachineShot{picture, view.name, estimate, own};
}

IntrinsicsPrior known_prior(IntrinsicsPrior prior, const MachineKnowledge& knowledge, bool mirrored) {
  prior.focal_px = knowledge.mean_mm.x() * prior.unit_px;
  *prior.principal_px +=
      prior.unit_px * Eigen::Vector2d((mirrored ? -1 : 1) * knowledge.mean_mm.y(), knowledge.mean_mm.z());
  return prior;
}

Expected<Machine> read_machine(const std::filesystem::path& path) {
  return read_json(path).and_then(
      [&](const Json& json) { return machine_from_json(json, path.filename().string()); });
}

Expected<Machine> machine_from_json(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    reader.choice("format", {"helicarm-machine/1"});
    Machine machine;
    for (JsonReader& shot : reader.objects("shots", true, most_shots))
      machine.shots.push_back(shot_from(shot));
    reader.finish();
    return machine;
  });
}

Json to_json(const Machine& machine) {
  Json json{{"format", "helicarm-machine/1"}, {"shots", Json::array()}};
  for (const MachineShot& shot : machine.shots)
    json["shots"].push_back(
        {{"picture", shot.picture},
         {"view", shot.view},
         {"estimate_mm", row(shot.estimate_mm)},
         {"information_per_mm2", Json::array({row(shot.information.col(0)), row(shot.information.col(1)),
                                              row(shot.information.col(2))})}});
  return json;
}

}  // namespace helicarm
