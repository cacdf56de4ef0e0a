// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/c_arm.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/random_vectors.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/phantom/conical_helix.h"
#include "helicarm/simulation/random_pose.h"
#include "helicarm/simulation/rotation.h"
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

Displacement displacement_of(const ArmState& from, const ArmState& to) {
  const Vector3d source = to.source_mm - from.source_mm;
  const Vector2d principal = to.principal_mm - from.principal_mm;
  return {source, source + Vector3d(-principal.x(), -principal.y(), to.f_mm - from.f_mm)};
}

/// The arm whose sag is `factor` times this one's.
ArmFlex with_sag(ArmFlex arm, double factor) {
  arm.f_per_weight *= factor;
  arm.principal_per_weight *= factor;
  arm.source_per_weight *= factor;
  arm.roll_per_weight *= factor;
  return arm;
}

/// After independent displacements of source and detector, `sigma_mm` per axis.
ArmState jittered(const ArmState& state, double sigma_mm, RandomStream& random) {
  const auto draw = [&] {
    Vector3d displacement;
    for (int axis = 0; axis < 3; ++axis) displacement[axis] = sigma_mm * random.normal();
    return displacement;
  };
  const Vector3d source = draw(), detector = draw();
  ArmState taken = state;
  taken.source_mm += source;
  taken.principal_mm += (source - detector).head<2>();
  taken.f_mm += detector.z() - source.z();
  return taken;
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

/// Orientation of an undeformed arm in the patient's frame (x distal, y lateral, z anterior).
Matrix3d upright(const ArmAngles& angles) {
  const Matrix3d from_below = (Matrix3d() << 0, -1, 0, 1, 0, 0, 0, 0, 1).finished();
  return from_below * turn(angles.secondary_deg, Vector3d::UnitY()) *
         turn(-angles.primary_deg, Vector3d::UnitX());
}

/// The same, lateral images rotated by 90 degrees, so that the leg lies across as in the operating room.
Matrix3d pointing(const ArmAngles& angles) {
  const bool from_the_side = std::abs(std::sin(angles.primary_deg * radian)) > std::sqrt(0.5);
  return turn(from_the_side ? 90 : 0, Vector3d::UnitZ()) * upright(angles);
}

std::vector<ArmAngles> angles_of(const Rotation& rotation) {
  std::vector<ArmAngles> angles;
  for (int i = 0; i < rotation.frames; ++i)
    angles.push_back({rotation.arc_deg * (double(i) / (rotation.frames - 1) - 0.5), 0});
  return angles;
}

/// Whose sag over the run is as requested.
ArmFlex sagging(const ArmFlex& arm, const Rotation& rotation) {
  if (!rotation.flex_mm) return arm;
  const ArmState undeformed = with_sag(arm, 0).at(Matrix3d::Identity());
  double largest = 0;
  for (const ArmAngles& angles : angles_of(rotation)) {
    const Displacement sag = displacement_of(undeformed, arm.at(upright(angles)));
    largest = std::max({largest, sag.source.norm(), sag.detector.norm()});
  }
  return with_sag(arm, *rotation.flex_mm / largest);
}

/// Camera, detector, imaging and plate of the arm in one state.
struct Surroundings {
  const SimulationOptions& options;
  const CArmModel& model;
  const ArmFlex& arm;
  Vector3d isocentre;
  double plate_height_mm;
  const geometry::RigidTransform& calibrator_from_patient;
};

void place(TrueView& true_view, const Surroundings& at, const Matrix3d& unbent, const ArmState& state,
           RandomStream& once) {
  const double pixel_mm = at.model.receiver_mm / at.options.size;
  const Vector2d middle = Vector2d::Constant(0.5 * (at.options.size - 1));
  true_view.f_mm = state.f_mm;
  true_view.nominal_f_mm = at.model.source_detector_mm;
  const Vector2d centre = middle + state.principal_mm / pixel_mm;
  true_view.view.intrinsics = {true_view.f_mm / pixel_mm, true_view.f_mm / pixel_mm, centre.x(), centre.y()};
  const Matrix3d rotation = turn(state.roll_deg, Vector3d::UnitZ()) * unbent;
  const geometry::RigidTransform camera_from_patient{
      rotation, Vector3d(0, 0, at.model.source_isocentre_mm) - state.source_mm - rotation * at.isocentre};
  true_view.view.camera_from_world = camera_from_patient * at.calibrator_from_patient.inverse();

  true_view.detector = {at.options.size, at.options.size, pixel_mm, at.arm.distortion, {}};
  true_view.detector.distortion.s_rotation = state.s_rotation;
  true_view.detector.distortion.shift_px = state.shift_mm / pixel_mm;
  if (at.model.intensifier) true_view.detector.field_radius_px = at.arm.distortion.radius_px;
  true_view.imaging = draw_imaging(at.options, 0.4925 * at.options.size, pixel_mm);
  // The plate is positioned manually and centred on the receiver, not on the central ray.
  true_view.camera_from_plate = {
      turn(once.uniform(-0.5, 0.5), Vector3d::UnitZ()),
      {once.uniform(-2, 2), once.uniform(-2, 2), true_view.f_mm - at.plate_height_mm}};
  true_view.camera_from_plate.translation.head<2>() += pixel_mm * (middle - centre);
}

Vector3d draw_isocentre(RandomStream& random) {
  return in_box(random, Vector3d(-4, -4, 34), Vector3d(4, 4, 40));
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
  const Surroundings at{
      options, model, arm, draw_isocentre(random), plate_height_mm, calibrator_from_patient};
  std::vector<TrueView> true_views;
  for (const ViewAngles& view : angles_of(options, random)) {
    TrueView true_view = named_view(options, view, static_cast<std::uint32_t>(true_views.size()));
    RandomStream once(options.seed, stream::true_views, true_view.number);
    true_view.true_angles.primary_deg += once.uniform(-0.05, 0.05);
    true_view.true_angles.secondary_deg += once.uniform(-0.05, 0.05);
    const Matrix3d unbent = pointing(true_view.true_angles);
    const ArmState state = unrepeated(arm.at(unbent), once);
    place(true_view, at, unbent, state, once);
    true_views.push_back(true_view);
  }
  return true_views;
}

RunStand take_run(const SimulationOptions& options, const Rotation& rotation, double plate_height_mm,
                  const geometry::RigidTransform& calibrator_from_patient) {
  const CArmModel model = model_of(options.c_arm_preset());
  const ArmFlex arm =
      sagging(draw_arm(options.arm_seed.value_or(options.seed), model, options.size), rotation);
  RandomStream random(options.seed, stream::c_arm);
  const Surroundings at{
      options, model, arm, draw_isocentre(random), plate_height_mm, calibrator_from_patient};
  RunStand stand;
  for (const ArmAngles& angles : angles_of(rotation)) {
    const auto number = static_cast<std::uint32_t>(stand.views.size());
    TrueView true_view;
    true_view.name = fmt::format("RUN/{}", number + 1);
    true_view.number = number;
    true_view.mirrored = options.has(Fault::mirrored);
    true_view.true_angles = angles;
    true_view.primary_angle_deg = rounded(angles.primary_deg, 0.01);
    true_view.secondary_angle_deg = rounded(angles.secondary_deg, 0.01);
    const Matrix3d unbent = upright(angles);
    const ArmState bent = arm.at(unbent);
    RandomStream once(options.seed, stream::jitter, number);
    const ArmState state = jittered(bent, rotation.jitter_mm, once);
    // The plate is mounted once for the run.
    RandomStream mounting(options.seed, stream::true_views);
    place(true_view, at, unbent, state, mounting);
    stand.views.push_back(true_view);
    stand.deviations.push_back(
        {displacement_of(with_sag(arm, 0).at(unbent), bent), displacement_of(bent, state)});
  }
  return stand;
}

}  // namespace helicarm::simulation
