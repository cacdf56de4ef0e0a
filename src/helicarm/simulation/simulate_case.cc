// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/simulate_case.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/simulation/calibrator_body.h"
#include "helicarm/simulation/faults.h"
#include "helicarm/simulation/knee.h"
#include "helicarm/simulation/random_pose.h"
#include "helicarm/simulation/streams.h"
#include "helicarm/simulation/wire_grid.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector2d;

constexpr std::size_t most_views = 20;
constexpr std::size_t most_distances = 20;
constexpr double least_distance_mm = 20;  // clear of plate48, whose balls end 16.25 mm from the receiver
constexpr double most_distance_mm = 500;

Expected<void> check_grid(const SimulationOptions& options) {
  if (options.ct) return fail(Reason::usage, "CT: kind grid has no knee");
  if (options.machine() == Preset::paper_sim)
    return fail(Reason::bad_value,
                "preset: paper-sim has no distortion, and its picture does not hold the plate; "
                "kind grid is for ii-9in and flat-panel");
  for (const Fault fault : options.faults)
    if (fault != Fault::low_dose && fault != Fault::saturated)
      return fail(
          Reason::bad_value,
          fmt::format("fault: {} does not occur in kind grid; low_dose and saturated do", word(fault)));
  if (!options.lost_balls.empty()) return fail(Reason::bad_value, "lost ball: kind grid has no calibrator");
  const std::vector<double>& distances = options.grid_distances_mm;
  if (distances.empty() || distances.size() > most_distances)
    return fail(Reason::bad_value, fmt::format("grid distances: {} of them, 1 to {} are possible",
                                               distances.size(), most_distances));
  for (std::size_t i = 0; i < distances.size(); ++i) {
    if (!(distances[i] >= least_distance_mm && distances[i] <= most_distance_mm))
      return fail(Reason::bad_value, fmt::format("grid distance: {} mm is outside {} to {} mm", distances[i],
                                                 least_distance_mm, most_distance_mm));
    if (std::count(distances.begin(), distances.end(), distances[i]) > 1)
      return fail(Reason::bad_value, fmt::format("grid distance: {} mm is given twice", distances[i]));
  }
  return {};
}

/// The name becomes a file's.
bool is_plain(const std::string& name) {
  return !name.empty() && name.size() <= 32 && std::ranges::all_of(name, [](unsigned char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
  });
}

Expected<void> check_views(const SimulationOptions& options) {
  const std::vector<ViewAngles>& views = options.views;
  const bool grid = options.kind == CaseKind::grid;
  if (grid ? views.size() > 1 : views.size() == 1 || views.size() > most_views)
    return fail(Reason::bad_value, fmt::format("views: {} given, {} possible", views.size(),
                                               grid ? "1 is" : fmt::format("2 to {} are", most_views)));
  for (const ViewAngles& view : views) {
    if (!is_plain(view.name))
      return fail(Reason::bad_value,
                  fmt::format("view: a name has 1 to 32 letters, digits, - or _; \"{}\" has not", view.name));
    if (std::ranges::count(views, view.name, &ViewAngles::name) > 1)
      return fail(Reason::bad_value, fmt::format("view: {} is given twice", view.name));
    if (!(std::abs(view.angles.primary_deg) <= 180 && std::abs(view.angles.secondary_deg) <= 60))
      return fail(Reason::bad_value,
                  fmt::format("view {}: angles {}, {} are outside +-180, +-60 degrees", view.name,
                              view.angles.primary_deg, view.angles.secondary_deg));
  }
  return {};
}

Expected<void> check(const SimulationOptions& options, const Calibrator& calibrator) {
  if (options.size != 512 && options.size != 1024)
    return fail(Reason::bad_value, fmt::format("size: {} is neither 512 nor 1024", options.size));
  if (options.bits < 8 || options.bits > 16 || options.bits % 2 != 0)
    return fail(Reason::bad_value, fmt::format("bits: {} is none of 8, 10, 12, 14 and 16", options.bits));
  if (const auto checked = check_views(options); !checked) return checked;
  if (options.kind == CaseKind::flat && model_of(options.machine()).intensifier)
    return fail(Reason::bad_value, fmt::format("preset: {} is an intensifier, kind flat is of a flat panel",
                                               word(options.machine())));
  if (options.ct && !options.knee)
    return fail(Reason::usage, "CT: it is the knee, so the knee cannot be left out");
  for (const std::string& lost : options.lost_balls)
    if (std::none_of(calibrator.balls.begin(), calibrator.balls.end(),
                     [&](const CalibratorBall& ball) { return ball.label == lost; }))
      return fail(Reason::bad_value, fmt::format("lost ball \"{}\" is none of {}'s", lost, calibrator.name));
  return {};
}

/// Within 3 px of the ball's centre, to a tenth of a pixel as a mouse on a zoomed picture gives it.
Click click(const TruePoint& point, RandomStream& random) {
  const double distance = 3 * std::sqrt(random.uniform());
  const double angle = random.uniform(0, 2 * EIGEN_PI);
  const Vector2d raw = point.raw + distance * Vector2d(std::cos(angle), std::sin(angle));
  return {point.name, (raw * 10).array().round().matrix() / 10};
}

void expose(SimulatedView& view, const Scene& scene, const SimulationOptions& options, std::uint32_t number,
            const CtBody* ct = nullptr) {
  const Shot& shot = view.shot;
  const Image<float> signal = render_view(scene, shot.detector, shot.view, options.threads, ct);
  view.pixels = develop(signal, shot.imaging, options.seed, stream::noise + 2 * number, options.threads);
  if (shot.mirrored) view.pixels = mirrored(view.pixels);
}

void add_plate_dots(SimulatedView& view, const Plate& plate, const Scene& scene) {
  const Shot& shot = view.shot;
  const RigidTransform world_from_plate = shot.view.camera_from_world.inverse() * shot.camera_from_plate;
  for (std::size_t i = 0; i < plate.dots_mm.size(); ++i) {
    const Vector2d& dot = plate.dots_mm[i];
    view.plate_dots.push_back(true_point(plate_dot_name(i),
                                         world_from_plate * Eigen::Vector3d(dot.x(), dot.y(), 0),
                                         plate.diameter_mm, scene, shot));
  }
}

SimulatedView take_view(const SimulatedCase& room, const Scene& patient, const Shot& shot,
                        std::uint32_t number, const CtBody* ct) {
  const SimulationOptions& options = room.options;
  Scene scene = patient;
  if (room.plate)
    for (const Body& dot : plate_body(*room.plate, shot.camera_from_plate, shot.view)) scene.push_back(dot);
  for (const Body& leaf : shutter_leaves(options, shot)) scene.push_back(leaf);

  SimulatedView view;
  view.shot = shot;
  expose(view, scene, options, number, ct);
  for (const CalibratorBall& ball : room.calibrator.balls)
    view.balls.push_back(true_point(ball.label, ball.centre_in_calibrator, ball.diameter_mm, scene, shot));
  for (const CalibratorTarget& target : room.calibrator.targets)
    view.targets.push_back(
        true_point(target.name, target.point_in_calibrator, target.diameter_mm, scene, shot));
  if (room.plate) add_plate_dots(view, *room.plate, scene);
  if (room.navigation) {
    RandomStream random(options.seed, stream::clicks, number);
    for (const TunnelPoint& point : room.navigation->points) {
      view.tunnel_points.push_back(true_point(point.name, point.in_calibrator, tunnel_ball_mm, scene, shot));
      view.clicks.push_back(click(view.tunnel_points.back(), random));
    }
  }
  return view;
}

SimulatedCase simulate_grid(SimulationOptions options) {
  options.knee = false;
  SimulatedCase room;
  room.options = options;
  room.plate = plate48();
  const WireGrid grid;
  for (const Shot& shot : take_grid_stand(options, *room.plate->height_above_receiver_mm)) {
    SimulatedView view;
    view.shot = shot;
    Scene scene = plate_body(*room.plate, shot.camera_from_plate, shot.view);
    if (!room.views.empty())
      for (const Body& wire : wire_grid_body(grid)) scene.push_back(wire);
    expose(view, scene, options, static_cast<std::uint32_t>(room.views.size()));
    add_plate_dots(view, *room.plate, scene);
    if (!room.views.empty()) view.crosses = grid_crosses(grid, scene, shot);
    room.views.push_back(std::move(view));
  }
  return room;
}

}  // namespace

Expected<SimulatedCase> simulate_case(const SimulationOptions& options) {
  SimulatedCase room;
  room.options = options;
  room.calibrator = udcsc();
  if (const auto checked = check(options, room.calibrator); !checked)
    return tl::unexpected<Failure>(checked.error());
  if (options.kind == CaseKind::grid) {
    if (const auto checked = check_grid(options); !checked) return tl::unexpected<Failure>(checked.error());
    return simulate_grid(options);
  }
  const bool tunnels = options.kind == CaseKind::tunnels;
  if (!tunnels) room.calibrator.targets = check_targets(room.calibrator);
  if (model_of(options.machine()).intensifier) room.plate = plate48();

  RandomStream random(options.seed, stream::patient);
  const RigidTransform calibrator_from_patient = random_motion(random, 1.2, 1.5);
  RigidTransform patient_from_knee = random_motion(random, 1.5, 1.5);
  patient_from_knee.translation += Eigen::Vector3d(10, 0, 14);
  const RigidTransform calibrator_from_knee = calibrator_from_patient * patient_from_knee;
  if (options.knee) room.calibrator_from_knee = calibrator_from_knee;

  const double plate_height = room.plate ? *room.plate->height_above_receiver_mm : 0;
  const std::vector<Shot> shots = take_stand(options, plate_height, calibrator_from_patient);
  Scene patient = calibrator_body(room.calibrator);
  std::erase_if(patient, [&](const Body& body) {
    return std::find(options.lost_balls.begin(), options.lost_balls.end(), body.name) !=
           options.lost_balls.end();
  });
  std::optional<CtBody> ct;
  if (options.ct) {
    room.calibrator_from_ct = calibrator_from_knee * knee_from_patient(*options.ct);
    ct.emplace(*options.ct, calibrator_from_knee, options.threads);
    for (const Shot& shot : shots)
      if (ct->contains(shot.view.source_in_world()))
        return fail(Reason::bad_value, fmt::format("{}: the X-ray source of {} lies inside the volume",
                                                   options.ct->name, shot.name));
  }
  if (options.knee && !ct)
    for (const Body& body : knee_body()) patient.push_back(moved(body, calibrator_from_knee));
  for (const Body& body : stray_metal(options, room.calibrator, shots, calibrator_from_knee))
    patient.push_back(body);
  if (tunnels) {
    room.navigation = set_up_navigation(options.seed, calibrator_from_knee);
    for (const TunnelPoint& point : room.navigation->points)
      patient.push_back(steel(point.name, {sphere(point.in_calibrator, tunnel_ball_mm / 2)}));
  }
  for (std::size_t i = 0; i < shots.size(); ++i)
    room.views.push_back(
        take_view(room, patient, shots[i], static_cast<std::uint32_t>(i), ct ? &*ct : nullptr));
  return room;
}

Exposure exposure_of(const SimulatedView& view) {
  Exposure exposure;
  exposure.name = view.shot.name;
  exposure.pixels = Image<float>(view.pixels.width(), view.pixels.height());
  std::ranges::copy(view.pixels.pixels(), exposure.pixels.pixels().begin());
  exposure.highest = static_cast<float>((1 << view.shot.imaging.bits) - 1);
  exposure.acquisition.pixel_mm = Eigen::Vector2d::Constant(view.shot.pixel_mm());
  exposure.acquisition.source_detector_mm = view.shot.nominal_f_mm;
  exposure.acquisition.logarithmic = view.shot.imaging.logarithmic;
  return exposure;
}

}  // namespace helicarm::simulation
