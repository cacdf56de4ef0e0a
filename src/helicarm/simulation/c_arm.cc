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

Imaging draw_imaging(const SimulationOptions& options, double field_radius_px, double pixel_mm) {
  const bool intensifier = model_of(options.c_arm_preset()).intensifier;
  Imaging imaging;
  imaging.quanta_per_pixel = 20000 * pixel_mm * pixel_mm * (options.has(Fault::low_dose) ? 0.05 : 1);
  imaging.scatter_sigma_px = 26 / pixel_mm;
  imaging.focus_sigma_px = 0.09 / pixel_mm;  // a 0.6 mm spot at magnification 1.5
  imaging.screen_sigma_px = (intensifier ? 0.15 : 0.10) / pixel_mm;
  imaging.vignette = intensifier ? 0.2 : 0.05;
  imaging.field_radius_px = field_radius_px;
  imaging.logarithmic = options.logarithmic();
  imaging.bits = options.bits;
  if (options.has(Fault::saturated)) imaging.open_level = options.logarithmic() ? 1.12 : 1.6;
  return imaging;
}

double rounded(double value, double step) { return step * std::round(value / step); }

/// The requested angles, or AP and lateral with a random positioning error.
std::vector<ViewAngles> angles_of(const SimulationOptions& options, RandomStream& random) {
  const double orbit = random.uniform(-3, 3);
  const double between = random.uniform(85, 95);
  if (!options.views.empty()) return options.views;
  return {{"AP", {orbit, random.uniform(-2, 2)}}, {"LAT", {orbit + between, random.uniform(-2, 2)}}};
}

TrueView named_view(const SimulationOptions& options, const ViewAngles& view, std::uint32_t number) {
  TrueView true_view;
  true_view.name = view.name;
  true_view.number = number;
  true_view.mirrored = number == 1 && options.has(Fault::mirrored);
  true_view.true_angles = view.angles;
  true_view.primary_angle_deg = rounded(view.angles.primary_deg, 0.5);
  true_view.secondary_angle_deg = rounded(view.angles.secondary_deg, 0.5);
  return true_view;
}

/// 2.3.3: Eq. 5 at (0, 0, 0) and (90, 0, 0) degrees, T = (0, 0, 800) mm. The world's origin is moved to the
/// middle of the cone: from its base the top of the spiral is outside the lateral image.
std::vector<TrueView> paper_stand(const SimulationOptions& options) {
  const CArmModel model = model_of(Preset::paper_sim);
  const phantom::ConicalHelix helix;
  const Vector3d middle(0, 0, 0.5 * helix.h * helix.t_end);
  const double pixel_mm = model.receiver_mm / options.size;
  const double f = model.source_detector_mm / pixel_mm;
  std::vector<TrueView> true_views;
  const std::vector<ViewAngles> printed = {{"AP", {0, 0}}, {"LAT", {90, 0}}};
  for (const ViewAngles& view : options.views.empty() ? printed : options.views) {
    TrueView true_view = named_view(options, view, static_cast<std::uint32_t>(true_views.size()));
    true_view.f_mm = true_view.nominal_f_mm = model.source_detector_mm;
    true_view.view.intrinsics = {f, f, 0.5 * options.size, 0.5 * options.size};
    const Matrix3d rotation = geometry::rotation_from_euler(view.angles.primary_deg * radian,
                                                            view.angles.secondary_deg * radian, 0);
    true_view.view.camera_from_world = {rotation,
                                        Vector3d(0, 0, model.source_isocentre_mm) - rotation * middle};
    true_view.detector = {options.size, options.size, pixel_mm, {}, {}};
    true_view.detector.distortion.centre_px = Vector2d::Constant(0.5 * (options.size - 1));
    true_view.imaging = draw_imaging(options, 0.4925 * options.size, pixel_mm);
    true_views.push_back(true_view);
  }
  return true_views;
}

/// Orientation of an undeformed arm in the patient's frame (x distal, y lateral, z anterior); lateral images
/// are rotated by 90 degrees, so that the leg lies across as in the operating room.
Matrix3d pointing(const ArmAngles& angles) {
  const Matrix3d from_below = (Matrix3d() << 0, -1, 0, 1, 0, 0, 0, 0, 1).finished();
  const bool from_the_side = std::abs(std::sin(angles.primary_deg * radian)) > std::sqrt(0.5);
  return turn(from_the_side ? 90 : 0, Vector3d::UnitZ()) * from_below *
         turn(angles.secondary_deg, Vector3d::UnitY()) * turn(-angles.primary_deg, Vector3d::UnitX());
}

}  // namespace

geometry::View TrueView::stored_view() const {
  geometry::View stored = view;
  if (mirrored) {
    stored.intrinsics.fx = -stored.intrinsics.fx;
    stored.intrinsics.u0 = detector.width - 1 - stored.intrinsics.u0;
  }
  return stored;
}

Vector2d TrueView::ideal_image(const Vector3d& point_in_calibrator) const {
  return stored_view().project(point_in_calibrator);
}

Vector2d TrueView::raw_image(const Vector3d& point_in_calibrator) const {
  Vector2d raw = detector.distortion.raw_from_ideal(view.project(point_in_calibrator));
  if (mirrored) raw.x() = detector.width - 1 - raw.x();
  return raw;
}

std::vector<TrueView> take_stand(const SimulationOptions& options, double plate_height_mm,
                                 const geometry::RigidTransform& calibrator_from_patient) {
  if (options.c_arm_preset() == Preset::paper_sim) return paper_stand(options);
  const CArmModel model = model_of(options.c_arm_preset());
  const ArmFlex arm = draw_arm(options.arm_seed.value_or(options.seed), model, options.size);
  RandomStream random(options.seed, stream::c_arm);
  const double pixel_mm = model.receiver_mm / options.size;
  const Vector2d middle = Vector2d::Constant(0.5 * (options.size - 1));
  const Vector3d isocentre(random.uniform(-4, 4), random.uniform(-4, 4), random.uniform(34, 40));

  std::vector<TrueView> true_views;
  for (const ViewAngles& view : angles_of(options, random)) {
    TrueView true_view = named_view(options, view, static_cast<std::uint32_t>(true_views.size()));
    RandomStream once(options.seed, stream::true_views, true_view.number);
    true_view.true_angles.primary_deg += once.uniform(-0.05, 0.05);
    true_view.true_angles.secondary_deg += once.uniform(-0.05, 0.05);
    const Matrix3d unbent = pointing(true_view.true_angles);
    const ArmState state = unrepeated(arm.at(unbent), once);
    true_view.f_mm = state.f_mm;
    true_view.nominal_f_mm = model.source_detector_mm;
    const Vector2d centre = middle + state.principal_mm / pixel_mm;
    true_view.view.intrinsics = {true_view.f_mm / pixel_mm, true_view.f_mm / pixel_mm, centre.x(),
                                 centre.y()};
    const Matrix3d rotation = turn(state.roll_deg, Vector3d::UnitZ()) * unbent;
    const geometry::RigidTransform camera_from_patient{
        rotation, Vector3d(0, 0, model.source_isocentre_mm) - state.source_mm - rotation * isocentre};
    true_view.view.camera_from_world = camera_from_patient * calibrator_from_patient.inverse();

    true_view.detector = {options.size, options.size, pixel_mm, arm.distortion, {}};
    true_view.detector.distortion.s_rotation = state.s_rotation;
    true_view.detector.distortion.shift_px = state.shift_mm / pixel_mm;
    if (model.intensifier) true_view.detector.field_radius_px = arm.distortion.radius_px;
    true_view.imaging = draw_imaging(options, 0.4925 * options.size, pixel_mm);
    // The plate is positioned manually and centred on the receiver, not on the central ray.
    true_view.camera_from_plate = {
        turn(once.uniform(-0.5, 0.5), Vector3d::UnitZ()),
        {once.uniform(-2, 2), once.uniform(-2, 2), true_view.f_mm - plate_height_mm}};
    true_view.camera_from_plate.translation.head<2>() += pixel_mm * (middle - centre);
    true_views.push_back(true_view);
  }
  return true_views;
}

}  // namespace helicarm::simulation
