// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/arm_flex.h"

#include <cmath>

#include "helicarm/core/random.h"
#include "helicarm/simulation/random_pose.h"
#include "helicarm/simulation/streams.h"

namespace helicarm::simulation {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double dip_deg = 65;  // of the earth's field below the horizon, as in central Europe

/// About 13 px of pincushion at the edge of a 1024 px field, with local faults of half a pixel.
IntensifierDistortion draw_distortion(RandomStream& random, int size) {
  const double unit = size / 1024.0;
  const Vector2d middle = Vector2d::Constant(0.5 * (size - 1));
  IntensifierDistortion distortion;
  distortion.radius_px = 0.4925 * size;
  distortion.centre_px = middle + in_disc(random, 3 * unit);
  distortion.k1 = -random.uniform(0.018, 0.028);
  distortion.k2 = -random.uniform(0.000, 0.004);
  for (int i = 0; i < 6; ++i) {
    const Vector2d centre = middle + in_disc(random, 380 * unit);
    const double sigma = random.uniform(35, 80) * unit;
    distortion.bumps.push_back({centre, sigma, in_disc(random, 0.5 * unit)});
  }
  return distortion;
}

/// Uniform in a ball of this radius.
Vector3d in_ball_of(RandomStream& random, double radius) {
  const double of_radius = std::cbrt(random.uniform());
  return random_rotation(random).col(0) * radius * of_radius;
}

}  // namespace

CArmModel model_of(Preset preset) {
  switch (preset) {
    case Preset::paper_sim:
      return {false, 153.6, 900, 800};
    case Preset::ii_9in:
      return {true, 235, 997, 650};
    case Preset::flat_panel:
      return {false, 297, 1020, 640};
  }
  return {};
}

ArmState ArmFlex::at(const Matrix3d& camera_from_patient) const {
  const Vector3d weight = -camera_from_patient.col(2);
  const Vector3d field = camera_from_patient * field_in_patient;
  return {f_mm + f_per_weight * weight, principal_mm + principal_per_weight * weight.head<2>(),
          source_per_weight * weight,   roll_deg + roll_per_weight * weight,
          s_rotation * field.z(),       shift_mm * Vector2d(-field.y(), field.x())};
}

ArmFlex draw_arm(std::uint64_t seed, const CArmModel& model, int size) {
  RandomStream random(seed, stream::arm);
  ArmFlex arm;
  arm.f_mm = model.source_detector_mm + random.uniform(-4, 4);
  // At most 6 mm here and 5.4 mm of sag: within 12 mm of the image centre in every view.
  arm.principal_mm = in_disc(random, 6);
  arm.roll_deg = random.uniform(-3, 3);
  arm.f_per_weight = in_ball_of(random, 0.9);
  arm.principal_per_weight << in_disc(random, 5.4), in_disc(random, 5.4);
  arm.source_per_weight << in_ball_of(random, 1), in_ball_of(random, 1), in_ball_of(random, 1);
  arm.roll_per_weight = in_ball_of(random, 1);
  if (model.intensifier)
    arm.distortion = draw_distortion(random, size);
  else
    arm.distortion.centre_px = Vector2d::Constant(0.5 * (size - 1));
  const double heading = random.uniform(0, 2 * EIGEN_PI);
  arm.field_in_patient = {std::cos(dip_deg * radian) * std::cos(heading),
                          std::cos(dip_deg * radian) * std::sin(heading), -std::sin(dip_deg * radian)};
  // 1 degree of S is 3 to 8 px at the edge; the screen's magnetisation has either sign.
  const double strength = model.intensifier ? random.uniform(-1, 1) : 0;
  arm.s_rotation = strength * radian;
  arm.shift_mm = 0.45 * strength;
  return arm;
}

ArmState unrepeated(const ArmState& state, RandomStream& random) {
  ArmState taken = state;
  taken.f_mm += random.uniform(-0.05, 0.05);
  taken.principal_mm += in_disc(random, 0.1);
  taken.source_mm += in_ball_of(random, 0.1);
  taken.roll_deg += random.uniform(-0.05, 0.05);
  if (state.s_rotation != 0) {
    taken.s_rotation += random.uniform(-0.01, 0.01) * radian;
    taken.shift_mm += in_disc(random, 0.02);
  }
  return taken;
}

}  // namespace helicarm::simulation
