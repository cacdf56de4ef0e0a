// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/c_arm.h"

#include <algorithm>
#include <cmath>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/phantom/conical_helix.h"
#include "helicarm/simulation/random_pose.h"
#include "helicarm/simulation/streams.h"

namespace helicarm::simulation {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

Matrix3d turn(double degrees, const Vector3d& axis) {
  return Eigen::AngleAxisd(degrees * radian, axis).toRotationMatrix();
}

Vector2d in_disc(RandomStream& random, double radius) {
  const double r = radius * std::sqrt(random.uniform());
  const double angle = random.uniform(0, 2 * EIGEN_PI);
  return {r * std::cos(angle), r * std::sin(angle)};
}

/// About 13 px of pincushion and 3 px of S at the edge of a 1024 px field, with faults of half a pixel.
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

Imaging draw_imaging(const SimulationOptions& options, double field_radius_px, double pixel_mm) {
  const bool intensifier = model_of(options.machine()).intensifier;
  Imaging imaging;
  imaging.quanta_per_pixel = 20000 * pixel_mm * pixel_mm * (options.has(Fault::low_dose) ? 0.05 : 1);
  imaging.scatter_sigma_px = 26 / pixel_mm;
  imaging.focus_sigma_px = 0.09 / pixel_mm;  // a 0.6 mm spot at magnification 1.5
  imaging.screen_sigma_px = (intensifier ? 0.15 : 0.10) / pixel_mm;
  imaging.vignette = intensifier ? 0.2 : 0.05;
  imaging.field_radius_px = field_radius_px;
  imaging.logarithmic = options.knee;
  imaging.bits = options.bits;
  if (options.has(Fault::saturated)) imaging.open_level = options.knee ? 1.12 : 1.6;
  return imaging;
}

double rounded(double value, double step) { return step * std::round(value / step); }

/// 2.3.3: Eq. 5 at (0, 0, 0) and (90, 0, 0) degrees, T = (0, 0, 800) mm. The world's origin is put to the
/// middle of the cone, since from its base the top of the spiral falls outside the lateral picture.
std::vector<Shot> paper_stand(const SimulationOptions& options) {
  const CArmModel model = model_of(Preset::paper_sim);
  const ConicalHelix helix;
  const Vector3d middle(0, 0, 0.5 * helix.h * helix.t_end);
  const double pixel_mm = model.receiver_mm / options.size;
  const double f = model.source_detector_mm / pixel_mm;
  std::vector<Shot> shots;
  for (const double alpha_deg : {0.0, 90.0}) {
    Shot shot;
    shot.name = shots.empty() ? "AP" : "LAT";
    shot.mirrored = !shots.empty() && options.has(Fault::mirrored);
    shot.f_mm = shot.nominal_f_mm = model.source_detector_mm;
    shot.primary_angle_deg = alpha_deg;
    shot.view.intrinsics = {f, f, 0.5 * options.size, 0.5 * options.size};
    const Matrix3d rotation = rotation_from_euler(alpha_deg * radian, 0, 0);
    shot.view.camera_from_world = {rotation, Vector3d(0, 0, model.source_isocentre_mm) - rotation * middle};
    shot.detector = {options.size, options.size, pixel_mm, {}, {}};
    shot.detector.distortion.centre_px = Vector2d::Constant(0.5 * (options.size - 1));
    shot.imaging = draw_imaging(options, 0.4925 * options.size, pixel_mm);
    shots.push_back(shot);
  }
  return shots;
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

View Shot::stored_view() const {
  View stored = view;
  if (mirrored) {
    stored.intrinsics.fx = -stored.intrinsics.fx;
    stored.intrinsics.u0 = detector.width - 1 - stored.intrinsics.u0;
  }
  return stored;
}

Vector2d Shot::ideal_image(const Vector3d& point_in_calibrator) const {
  return stored_view().project(point_in_calibrator);
}

Vector2d Shot::raw_image(const Vector3d& point_in_calibrator) const {
  Vector2d raw = detector.distortion.raw_from_ideal(view.project(point_in_calibrator));
  if (mirrored) raw.x() = detector.width - 1 - raw.x();
  return raw;
}

std::vector<Shot> take_stand(const SimulationOptions& options, double plate_height_mm,
                             const RigidTransform& calibrator_from_patient) {
  if (options.machine() == Preset::paper_sim) return paper_stand(options);
  const CArmModel model = model_of(options.machine());
  RandomStream random(options.seed, stream::c_arm);
  const double pixel_mm = model.receiver_mm / options.size;
  const double unit = options.size / 1024.0;
  const double f = model.source_detector_mm + random.uniform(-4, 4);
  const Vector2d middle = Vector2d::Constant(0.5 * (options.size - 1));
  // At most 6.2 mm here and 5.7 mm (25 px) of sag: within 12 mm of the middle in both views.
  const Vector2d principal = middle + in_disc(random, 6.2) / pixel_mm;
  const Vector2d sag = in_disc(random, 25 * unit);
  IntensifierDistortion distortion;
  if (model.intensifier)
    distortion = draw_distortion(random, options.size);
  else
    distortion.centre_px = middle;
  // Seen from the patient (x distal, y lateral, z anterior): AP looks up from below, the lateral view from
  // the side.
  const Matrix3d nominal[2] = {(Matrix3d() << 0, -1, 0, 1, 0, 0, 0, 0, 1).finished(),
                               (Matrix3d() << -1, 0, 0, 0, 0, -1, 0, -1, 0).finished()};
  const Vector3d isocentre(random.uniform(-4, 4), random.uniform(-4, 4), random.uniform(34, 40));
  const double orbit = random.uniform(-3, 3);
  const double between = random.uniform(85, 95);

  std::vector<Shot> shots;
  for (std::size_t i = 0; i < 2; ++i) {
    Shot shot;
    shot.name = i == 0 ? "AP" : "LAT";
    shot.mirrored = i == 1 && options.has(Fault::mirrored);
    shot.f_mm = f + random.uniform(-1, 1);
    shot.nominal_f_mm = model.source_detector_mm;
    const double primary = i == 0 ? orbit : orbit + between;
    const double secondary = random.uniform(-2, 2);
    shot.primary_angle_deg = rounded(primary, 0.5);
    shot.secondary_angle_deg = rounded(secondary, 0.5);

    const Vector2d centre = i == 0 ? principal : Vector2d(principal + sag);
    shot.view.intrinsics = {shot.f_mm / pixel_mm, shot.f_mm / pixel_mm, centre.x(), centre.y()};
    const Matrix3d gantry =
        turn(secondary, Vector3d::UnitY()) * turn(i == 0 ? -primary : 90 - primary, Vector3d::UnitX());
    const Matrix3d rotation = turn(random.uniform(-4, 4), Vector3d::UnitZ()) * nominal[i] * gantry;
    const RigidTransform camera_from_patient{
        rotation, Vector3d(0, 0, model.source_isocentre_mm) - rotation * isocentre};
    shot.view.camera_from_world = camera_from_patient * calibrator_from_patient.inverse();

    shot.detector = {options.size, options.size, pixel_mm, distortion, {}};
    if (model.intensifier) {
      shot.detector.field_radius_px = distortion.radius_px;
      // The earth's field and the screen's place change with the arm's.
      shot.detector.distortion.s_rotation = random.uniform(-0.9, 0.9) * radian;
      shot.detector.distortion.shift_px = in_disc(random, 2 * unit);
    }
    shot.imaging = draw_imaging(options, 0.4925 * options.size, pixel_mm);
    shot.camera_from_plate = {turn(random.uniform(-0.5, 0.5), Vector3d::UnitZ()),
                              {random.uniform(-2, 2), random.uniform(-2, 2), shot.f_mm - plate_height_mm}};
    // The plate is centred on the receiver, not on the central ray.
    shot.camera_from_plate.translation.head<2>() += pixel_mm * (middle - centre);
    shots.push_back(shot);
  }
  return shots;
}

}  // namespace helicarm::simulation
