// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/simulate_case.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include <fmt/format.h>

#include "helicarm/simulation/calibrator_body.h"
#include "helicarm/simulation/faults.h"
#include "helicarm/simulation/knee.h"
#include "helicarm/simulation/random_pose.h"
#include "helicarm/simulation/rotation.h"
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
  if (options.c_arm_preset() == Preset::paper_sim)
    return fail(Reason::bad_value,
                "preset: paper-sim has no distortion, and its image does not contain the plate; "
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

/// The name becomes a file name.
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
      return fail(
          Reason::bad_value,
          fmt::format("view: a name has 1 to 32 letters, digits, - or _; \"{}\" does not match", view.name));
    if (std::ranges::count(views, view.name, &ViewAngles::name) > 1)
      return fail(Reason::bad_value, fmt::format("view: {} is given twice", view.name));
    if (!(std::abs(view.angles.primary_deg) <= 180 && std::abs(view.angles.secondary_deg) <= 60))
      return fail(Reason::bad_value,
                  fmt::format("view {}: angles {}, {} are outside +-180, +-60 degrees", view.name,
                              view.angles.primary_deg, view.angles.secondary_deg));
  }
  return {};
}

Expected<void> check_rotation(const SimulationOptions& options, const Rotation& rotation) {
  constexpr double most_mm = 20;
  if (options.kind == CaseKind::tunnels || options.kind == CaseKind::grid)
    return fail(Reason::usage, fmt::format("run: is not of kind {}", word(options.kind)));
  if (!options.views.empty()) return fail(Reason::usage, "run: views cannot be given too");
  if (options.c_arm_preset() == Preset::paper_sim)
    return fail(Reason::bad_value, "run: preset paper-sim has two views; choose ii-9in or flat-panel");
  if (options.has(Fault::wires))
    return fail(Reason::bad_value, "fault: wires, one over a ball of each view, do not occur in a run");
  if (rotation.frames < 2 || rotation.frames > 1000)
    return fail(Reason::bad_value, fmt::format("run: {} images, must be 2 to 1000", rotation.frames));
  if (!(rotation.arc_deg >= 1 && rotation.arc_deg <= 360))
    return fail(Reason::bad_value, fmt::format("arc: {} degrees, must be 1 to 360", rotation.arc_deg));
  for (const auto& [name, value] :
       {std::pair{"flex", rotation.flex_mm.value_or(0)}, {"jitter", rotation.jitter_mm}})
    if (!(value >= 0 && value <= most_mm))
      return fail(Reason::bad_value, fmt::format("{}: {} mm, must be 0 to {}", name, value, most_mm));
  return {};
}

Expected<void> check(const SimulationOptions& options, const phantom::Calibrator& calibrator, bool is_run) {
  const bool is_small_run = is_run && options.size == 256;
  if (!is_small_run && options.size != 512 && options.size != 1024)
    return fail(Reason::bad_value,
                fmt::format("size: {}, must be {}512 or 1024", options.size, is_run ? "256, " : ""));
  if (options.bits < 8 || options.bits > 16 || options.bits % 2 != 0)
    return fail(Reason::bad_value, fmt::format("bits: {}, must be 8, 10, 12, 14 or 16", options.bits));
  if (const auto checked = check_views(options); !checked) return checked;
  if (options.kind == CaseKind::flat && model_of(options.c_arm_preset()).intensifier)
    return fail(Reason::bad_value, fmt::format("preset: {} is an intensifier, kind flat is of a flat panel",
                                               word(options.c_arm_preset())));
  if (options.calibrator && options.c_arm_preset() == Preset::paper_sim)
    return fail(Reason::bad_value, "calibrator: preset paper-sim is of the built-in calibrator");
  if (options.plate && !model_of(options.c_arm_preset()).intensifier)
    return fail(Reason::bad_value, fmt::format("plate: preset {} is not an intensifier and has no plate",
                                               word(options.c_arm_preset())));
  if (options.ct && !options.knee) return fail(Reason::usage, "CT: --no-knee cannot be combined with --ct");
  for (const std::string& lost : options.lost_balls)
    if (std::none_of(calibrator.balls.begin(), calibrator.balls.end(),
                     [&](const phantom::CalibratorBall& ball) { return ball.label == lost; }))
      return fail(Reason::bad_value,
                  fmt::format("lost ball \"{}\" is not a ball of {}", lost, calibrator.name));
  return {};
}

/// Within 3 px of the ball's centre, rounded to 0.1 px as by a mouse on a zoomed image.
Click click(const TruePoint& point, RandomStream& random) {
  const double distance = 3 * std::sqrt(random.uniform());
  const double angle = random.uniform(0, 2 * EIGEN_PI);
  const Vector2d raw = point.raw + distance * Vector2d(std::cos(angle), std::sin(angle));
  return {point.name, (raw * 10).array().round().matrix() / 10};
}

void expose(SimulatedView& view, const Scene& scene, const SimulationOptions& options, std::uint32_t number,
            const CtBody* ct = nullptr) {
  const TrueView& true_view = view.true_view;
  const image::Image<float> signal =
      render_view(scene, true_view.detector, true_view.view, options.threads, ct);
  view.pixels =
      detector_response(signal, true_view.imaging, options.seed, stream::noise + 2 * number, options.threads);
  if (true_view.mirrored) view.pixels = mirrored(view.pixels);
}

void add_plate_dots(SimulatedView& view, const phantom::Plate& plate, const Scene& scene) {
  const TrueView& true_view = view.true_view;
  const geometry::RigidTransform world_from_plate =
      true_view.view.camera_from_world.inverse() * true_view.camera_from_plate;
  for (std::size_t i = 0; i < plate.dots_mm.size(); ++i) {
    const Vector2d& dot = plate.dots_mm[i];
    view.plate_dots.push_back(true_point(plate_dot_name(i),
                                         world_from_plate * Eigen::Vector3d(dot.x(), dot.y(), 0),
                                         plate.diameter_mm, scene, true_view));
  }
}

SimulatedView take_view(const SimulatedCase& simulated_case, const Scene& patient, const TrueView& true_view,
                        std::uint32_t number, const CtBody* ct) {
  const SimulationOptions& options = simulated_case.options;
  Scene scene = patient;
  if (simulated_case.plate)
    for (const Body& dot : plate_body(*simulated_case.plate, true_view.camera_from_plate, true_view.view))
      scene.push_back(dot);
  for (const Body& leaf : shutter_leaves(options, true_view)) scene.push_back(leaf);

  SimulatedView view;
  view.true_view = true_view;
  expose(view, scene, options, number, ct);
  for (const phantom::CalibratorBall& ball : simulated_case.calibrator.balls)
    view.balls.push_back(
        true_point(ball.label, ball.centre_in_calibrator, ball.diameter_mm, scene, true_view));
  for (const phantom::CalibratorTarget& target : simulated_case.calibrator.targets)
    view.targets.push_back(
        true_point(target.name, target.point_in_calibrator, target.diameter_mm, scene, true_view));
  if (simulated_case.plate) add_plate_dots(view, *simulated_case.plate, scene);
  if (simulated_case.navigation) {
    RandomStream random(options.seed, stream::clicks, number);
    for (const TunnelPoint& point : simulated_case.navigation->points) {
      view.tunnel_points.push_back(
          true_point(point.name, point.in_calibrator, tunnel_ball_mm, scene, true_view));
      view.clicks.push_back(click(view.tunnel_points.back(), random));
    }
  }
  return view;
}

constexpr double usual_height_mm = 15;  // of a plate that does not state it
constexpr double plate_radius_mm = 130;

double plate_height_mm(const phantom::Plate& plate) {
  return plate.height_above_receiver_mm.value_or(usual_height_mm);
}

/// With its dots listed, in whatever way the file gives them.
Expected<phantom::Plate> plate_of(const SimulationOptions& options) {
  phantom::Plate plate = options.plate.value_or(phantom::plate48());
  return dots_within(plate, plate_radius_mm).map([&](std::vector<Eigen::Vector2d> dots) {
    plate.dots_mm = std::move(dots);
    return plate;
  });
}

SimulatedCase simulate_grid(SimulationOptions options) {
  options.knee = false;
  SimulatedCase simulated_case;
  simulated_case.options = options;
  simulated_case.plate = value_or_throw(plate_of(options));
  const WireGrid grid;
  for (const TrueView& true_view : take_grid_stand(options, plate_height_mm(*simulated_case.plate))) {
    SimulatedView view;
    view.true_view = true_view;
    Scene scene = plate_body(*simulated_case.plate, true_view.camera_from_plate, true_view.view);
    if (!simulated_case.views.empty())
      for (const Body& wire : wire_grid_body(grid)) scene.push_back(wire);
    expose(view, scene, options, static_cast<std::uint32_t>(simulated_case.views.size()));
    add_plate_dots(view, *simulated_case.plate, scene);
    if (!simulated_case.views.empty()) view.crosses = grid_crosses(grid, scene, true_view);
    simulated_case.views.push_back(std::move(view));
  }
  return simulated_case;
}

/// By the height of the plate and the pose of the patient.
using Stand = std::function<std::vector<TrueView>(double, const geometry::RigidTransform&)>;

Expected<SimulatedCase> simulate_views(const SimulationOptions& options, const Stand& stand, bool is_run) {
  SimulatedCase simulated_case;
  simulated_case.options = options;
  simulated_case.calibrator = options.calibrator.value_or(phantom::udcsc());
  if (const auto checked = check(options, simulated_case.calibrator, is_run); !checked)
    return tl::unexpected<Failure>(checked.error());
  if (options.kind == CaseKind::grid) {
    if (const auto checked = check_grid(options); !checked) return tl::unexpected<Failure>(checked.error());
    return guarded([&] { return simulate_grid(options); });
  }
  const bool tunnels = options.kind == CaseKind::tunnels;
  if (tunnels)
    simulated_case.calibrator.targets.clear();
  else if (!options.calibrator)
    simulated_case.calibrator.targets = check_targets(simulated_case.calibrator);
  if (model_of(options.c_arm_preset()).intensifier) {
    auto plate = plate_of(options);
    if (!plate) return tl::unexpected<Failure>(plate.error());
    simulated_case.plate = *std::move(plate);
  }

  RandomStream random(options.seed, stream::patient);
  geometry::RigidTransform calibrator_from_patient = random_motion(random, 1.2, 1.5);
  if (options.calibrator)
    calibrator_from_patient.translation +=
        phantom::middle_of(simulated_case.calibrator) - phantom::middle_of(phantom::udcsc());
  geometry::RigidTransform patient_from_knee = random_motion(random, 1.5, 1.5);
  patient_from_knee.translation += Eigen::Vector3d(10, 0, 14);
  const geometry::RigidTransform calibrator_from_knee = calibrator_from_patient * patient_from_knee;
  if (options.knee) simulated_case.calibrator_from_knee = calibrator_from_knee;

  const double plate_height = simulated_case.plate ? plate_height_mm(*simulated_case.plate) : 0;
  const std::vector<TrueView> true_views = stand(plate_height, calibrator_from_patient);
  Scene patient = calibrator_body(simulated_case.calibrator);
  std::erase_if(patient, [&](const Body& body) {
    return std::find(options.lost_balls.begin(), options.lost_balls.end(), body.name) !=
           options.lost_balls.end();
  });
  std::optional<CtBody> ct;
  if (options.ct) {
    simulated_case.calibrator_from_ct = calibrator_from_knee * knee_from_patient(*options.ct);
    ct.emplace(*options.ct, calibrator_from_knee, options.threads);
    for (const TrueView& true_view : true_views)
      if (ct->contains(true_view.view.source_in_world()))
        return fail(Reason::bad_value, fmt::format("{}: the X-ray source of {} lies inside the volume",
                                                   options.ct->name, true_view.name));
  }
  if (options.knee && !ct)
    for (const Body& body : knee_body()) patient.push_back(moved(body, calibrator_from_knee));
  for (const Body& body : stray_metal(options, simulated_case.calibrator, true_views, calibrator_from_knee))
    patient.push_back(body);
  if (tunnels) {
    simulated_case.navigation = set_up_navigation(options.seed, calibrator_from_knee);
    for (const TunnelPoint& point : simulated_case.navigation->points)
      patient.push_back(steel(point.name, {sphere(point.in_calibrator, tunnel_ball_mm / 2)}));
  }
  for (std::size_t i = 0; i < true_views.size(); ++i)
    simulated_case.views.push_back(take_view(simulated_case, patient, true_views[i],
                                             static_cast<std::uint32_t>(i), ct ? &*ct : nullptr));
  return simulated_case;
}

}  // namespace

Expected<SimulatedCase> simulate_case(const SimulationOptions& options) {
  return simulate_views(
      options,
      [&](double plate_height_mm, const geometry::RigidTransform& calibrator_from_patient) {
        return take_stand(options, plate_height_mm, calibrator_from_patient);
      },
      false);
}

Expected<SimulatedRun> simulate_run(const SimulationOptions& options, const Rotation& rotation) {
  if (const auto checked = check_rotation(options, rotation); !checked)
    return tl::unexpected<Failure>(checked.error());
  std::vector<RunDeviation> deviations;
  auto images = simulate_views(
      options,
      [&](double plate_height_mm, const geometry::RigidTransform& calibrator_from_patient) {
        RunStand stand = take_run(options, rotation, plate_height_mm, calibrator_from_patient);
        deviations = std::move(stand.deviations);
        return std::move(stand.views);
      },
      true);
  return std::move(images).map([&](SimulatedCase simulated) {
    return SimulatedRun{rotation, std::move(simulated), std::move(deviations)};
  });
}

xray::XrayImage exposure_of(const SimulatedView& view) {
  xray::XrayImage xray_image;
  xray_image.name = view.true_view.name;
  xray_image.pixels = image::Image<float>(view.pixels.width(), view.pixels.height());
  std::ranges::copy(view.pixels.pixels(), xray_image.pixels.pixels().begin());
  xray_image.highest = static_cast<float>((1 << view.true_view.imaging.bits) - 1);
  xray_image.acquisition.pixel_mm = Eigen::Vector2d::Constant(view.true_view.pixel_mm());
  xray_image.acquisition.source_detector_mm = view.true_view.nominal_f_mm;
  xray_image.acquisition.logarithmic = view.true_view.imaging.logarithmic;
  return xray_image;
}

}  // namespace helicarm::simulation
