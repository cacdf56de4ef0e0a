// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/knee.h"

#include <utility>
#include <vector>

namespace helicarm::simulation {
namespace {

using Eigen::Vector3d;

Eigen::Matrix3d bent(double degrees) {
  return Eigen::AngleAxisd(degrees * EIGEN_PI / 180, Vector3d::UnitY()).toRotationMatrix();
}

/// Part of a bone, `inset` mm inside its surface.
Solid knob(const Vector3d& centre, const Vector3d& semi_axes, double degrees, double inset) {
  return ellipsoid(centre, semi_axes.array() - inset, bent(degrees));
}

/// A shaft, flattened in the anterior-posterior direction.
Solid shaft(const Vector3d& from, const Vector3d& to, double from_radius, double to_radius, double inset,
            double flattening = 1) {
  return flat_frustum(from, to, from_radius - inset, to_radius - inset, Vector3d::UnitZ(), flattening);
}

/// ratio of the shaft's shell thickness to that of the ends
constexpr double shaft_shell = 4;

std::vector<Solid> femur(double inset) {
  return {knob({-19, -23, -10}, {20, 14, 30}, -12, inset),
          knob({-19, 23, -10}, {20, 15, 28}, -12, inset),
          knob({-29, 0, 4}, {19, 31, 17}, -20, inset),
          knob({-33, 0, -5}, {20, 34, 20}, 10, inset),
          shaft({-36, 0, -6}, {-82, 0, -15}, 32, 16, inset, 0.62),
          shaft({-60, 0, -11}, {-175, 0, -36}, 16, 14, shaft_shell * inset)};
}

std::vector<Solid> tibia(double inset) {
  return {knob({10, -17, -8}, {9, 21, 24}, 8, inset), knob({10, 18, -8}, {9, 20, 23}, 8, inset),
          knob({4, 0, -8}, {8, 6, 7}, 8, inset), shaft({10, 0, -8}, {60, 0, -19}, 36, 16, inset, 0.68),
          shaft({45, 0, -16}, {170, 0, -52}, 16, 12, shaft_shell * inset)};
}

std::vector<Solid> fibula(double inset) {
  return {knob({24, 37, -22}, {12, 8, 10}, 10, inset), shaft({26, 37, -22}, {165, 30, -62}, 7, 6, inset)};
}

std::vector<Solid> patella(double inset) { return {knob({-26, 0, 34}, {21, 22, 9}, 9, inset)}; }

std::vector<Solid> skin() {
  return {flat_frustum({-10, 0, -9}, {-175, 0, -38}, 60, 76, Vector3d::UnitZ(), 0.92),
          flat_frustum({-12, 0, -9}, {170, 0, -60}, 60, 50, Vector3d::UnitZ(), 0.9),
          ellipsoid({-18, 0, -4}, {62, 61, 54})};
}

void add_bone(Scene& scene, const char* name, std::vector<Solid> (*bone)(double inset), double shell) {
  scene.push_back({name, bone(0), material::cortical_bone - material::muscle});
  scene.push_back({name, bone(shell), material::spongy_bone - material::cortical_bone});
}

}  // namespace

Scene knee_body() {
  Scene scene;
  scene.push_back({"skin", skin(), material::muscle});
  add_bone(scene, "femur", femur, 1.2);
  add_bone(scene, "tibia", tibia, 1.2);
  add_bone(scene, "patella", patella, 1.5);
  add_bone(scene, "fibula", fibula, 2);
  return scene;
}

KneeTunnel femoral_tunnel() { return {{-14, 10, -16}, {-44, 27, 4}}; }
KneeTunnel tibial_tunnel() { return {{46, -14, -2}, {3, 1, -6}}; }

}  // namespace helicarm::simulation
