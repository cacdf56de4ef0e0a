// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/ct_body.h"

#include <vector>

#include <Eigen/Geometry>

namespace helicarm::simulation {
namespace {

/// NIST tables, as for the other materials.
const Attenuation water{0.02683, 0.02059, 0.01837};

// At about 70 keV, the effective energy of CT at 120 kV: cortical bone 0.0503 / mm, water 0.0193 / mm (NIST).
constexpr double bone_hu = 1600;
constexpr double air_hu = -800;

constexpr volume::Ramp water_ramp{1, 1e-3, 0, 1, air_hu};
constexpr volume::Ramp bone_ramp{0, 1 / bone_hu, 0, 1e30, air_hu};

}  // namespace

geometry::RigidTransform knee_from_patient(const CtOptions& options) {
  geometry::RigidTransform placed;
  placed.rotation << 0, 0, -1, 1, 0, 0, 0, -1, 0;
  const Eigen::Vector3d turn = options.turn_deg * (EIGEN_PI / 180);
  placed.rotation = (Eigen::AngleAxisd(turn.z(), Eigen::Vector3d::UnitZ()) *
                     Eigen::AngleAxisd(turn.y(), Eigen::Vector3d::UnitY()) *
                     Eigen::AngleAxisd(turn.x(), Eigen::Vector3d::UnitX()))
                        .toRotationMatrix() *
                    placed.rotation;
  placed.translation = -(placed.rotation * options.centre.value_or(options.volume.centre()));
  return placed;
}

CtBody::CtBody(const CtOptions& options, const geometry::RigidTransform& world_from_knee, unsigned threads)
    : patient_from_world_((world_from_knee * knee_from_patient(options)).inverse()),
      water_(options.volume, water_ramp, threads),
      bone_(options.volume, bone_ramp, threads) {}

void CtBody::add_depths(const Eigen::Vector3d& source, std::span<const Eigen::Vector3d> directions,
                        std::span<Eigen::Array3d> depths) const {
  std::vector<Eigen::Vector3d> in_patient;
  for (const Eigen::Vector3d& direction : directions)
    in_patient.push_back(patient_from_world_.rotation * direction);
  std::vector<float> water_mm(directions.size());
  std::vector<float> bone_mm(directions.size());
  water_.integrate(patient_from_world_ * source, in_patient, water_mm);
  bone_.integrate(patient_from_world_ * source, in_patient, bone_mm);
  for (std::size_t i = 0; i < depths.size(); ++i)
    depths[i] += static_cast<double>(water_mm[i]) * water +
                 static_cast<double>(bone_mm[i]) * (material::cortical_bone - water);
}

bool CtBody::contains(const Eigen::Vector3d& point_in_world) const {
  return water_.contains(patient_from_world_ * point_in_world);
}

}  // namespace helicarm::simulation
