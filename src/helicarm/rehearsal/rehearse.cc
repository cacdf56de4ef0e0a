// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rehearsal/rehearse.h"

#include <algorithm>
#include <chrono>
#include <numbers>
#include <thread>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "helicarm/core/random_vectors.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/operation/connections.h"
#include "helicarm/rehearsal/ct_plan.h"

namespace helicarm::rehearsal {
namespace {

using virtual_devices::VirtualDevices;

constexpr std::chrono::seconds patience{20};
constexpr double image_patience_s = 20;
constexpr int most_attempts = 3;
constexpr std::chrono::seconds drilling_patience{60};
constexpr double raise_s = 2;  ///< to the next tunnel
/// The pose window of an acquisition is the 1.5 s before an image's arrival.
constexpr std::chrono::milliseconds before_exposure{1800};
constexpr double chi2_95_of_two = 5.991;

constexpr std::uint32_t drill_stream = 2901;
constexpr double drill_sigma_mm = 0.1;

/// Of virtual_tracker: rms drift per axis, and rotation error after averaging over 1 s.
constexpr double kept_sigma_mm = 0.114;
constexpr double kept_sigma_deg = 0.03;

std::vector<pipeline::Pick> clicks_of(const simulation::SimulatedCase& virtual_or) {
  std::vector<pipeline::Pick> picks;
  for (const simulation::SimulatedView& view : virtual_or.views)
    for (std::size_t i = 0; i < view.clicks.size(); ++i)
      picks.push_back({.name = view.clicks[i].point,
                       .view = view.true_view.name,
                       .uv_raw = view.clicks[i].raw,
                       .snap = pipeline::Snap::ball,
                       .diameter_mm = simulation::tunnel_ball_mm,
                       .sigma_px = {},
                       .moves_with = virtual_or.navigation->points[i].bone});
  return picks;
}

/// Small motion of a leg that is not fixed.
void stir(virtual_devices::SimulatedScene& simulated_scene) {
  const auto motion = [](double degrees, const Eigen::Vector3d& axis, const Eigen::Vector3d& shift) {
    return geometry::RigidTransform{
        Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis.normalized()).toRotationMatrix(), shift};
  };
  simulated_scene.move_bone("femur", motion(1.5, {1, 2, -1}, {2, -1.5, 1}));
  simulated_scene.move_bone("tibia", motion(-2, {2, -1, 1}, {-1, 2, 1.5}));
}

EndError end_error(const std::string& name, const operation::EndMiss& miss,
                   const std::optional<guidance::LineError>& in_xrays, VirtualDevices& virtual_or) {
  const Eigen::Vector2d across =
      (virtual_or.tracker_from_tip().inverse() * virtual_or.simulated_scene().point_in_tracker(name))
          .head<2>();
  const Eigen::Vector2d off = across - miss.across_mm;
  return {name,
          across.norm(),
          miss.distance_mm(),
          miss.predicted_mm(),
          off.dot(miss.covariance.inverse() * off) <= chi2_95_of_two,
          in_xrays ? std::optional(in_xrays->combined_mm) : std::nullopt,
          off.norm()};
}

/// Acquires an image; repeats where a busy machine delayed the tracker.
Expected<void> expose(const std::string& view, VirtualDevices& virtual_or, operation::Connections& devices,
                      operation::Operation& operation) {
  Expected<void> taken = fail(Reason::not_connected, "no image received");
  for (int attempt = 0; attempt < most_attempts && !taken; ++attempt) {
    std::this_thread::sleep_for(before_exposure);
    if (auto true_view = virtual_devices::shoot(virtual_or.simulated_scene(), view,
                                                {"127.0.0.1", devices.receiver_port()});
        !true_view)
      return true_view;
    const auto image = devices.next_image(image_patience_s);
    if (image) taken = operation.take(view, image->arrival, image->time_s);
  }
  return taken;
}

operation::RobotPlan robot_plan(const robot::VirtualUr& robot,
                                const virtual_devices::SimulatedScene& simulated_scene) {
  operation::RobotPlan plan;
  plan.rtde_port = robot.rtde_port();
  plan.dashboard_port = robot.dashboard_port();
  plan.script_port = robot.script_port();
  plan.tool = simulated_scene.tool();
  plan.approach.corrections.most = 8;
  plan.approach.corrections.tolerance_mm = 0.25;
  plan.approach.corrections.tolerance_deg = 0.25;
  return plan;
}

/// As two pivot calibrations of the drill would find it: with errors of its own standard deviation.
operation::HandDrill calibrated_drill(const virtual_devices::HeldDrill& drill) {
  RandomStream random(drill.seed(), drill_stream);
  const auto error = [&] { return Eigen::Vector3d(drill_sigma_mm * normal_3(random)); };
  const geometry::RigidTransform& marker_from_tip = drill.marker_from_tip();
  return {marker_from_tip.translation + error(), marker_from_tip * Eigen::Vector3d(0, 0, -120) + error(),
          drill_sigma_mm};
}

/// The ball at a tunnel's end.
std::string ball_at(const operation::OperationTunnel& tunnel, bool start) {
  if (!tunnel.of_model) return start ? tunnel.start : tunnel.end;
  return std::string(tunnel.bone == "femur" ? "F" : "T") + (start ? "S" : "E");
}

void add_ends(Rehearsal& done, const operation::OperationTunnel& tunnel,
              const operation::TunnelOutcome& outcome, VirtualDevices& virtual_or) {
  using guidance::Verification, guidance::LineError;
  const auto in_xrays = [&](const std::optional<LineError> Verification::*end) {
    return outcome.verification ? (*outcome.verification).*end : std::nullopt;
  };
  done.ends.push_back(
      end_error(ball_at(tunnel, true), outcome.start, in_xrays(&Verification::start), virtual_or));
  done.ends.push_back(
      end_error(ball_at(tunnel, false), outcome.end, in_xrays(&Verification::end), virtual_or));
}

/// Virtual devices and an operation on them, after its measurement.
struct Stage {
  Stage(std::uint64_t seed, const std::filesystem::path& folder, const RehearsalOptions& options,
        bool freehand) {
    options.notify("starting the virtual devices");
    virtual_devices::VirtualDevicesOptions ports{seed, options.image_size, options.tracker_rate_hz, 0, 0, 0,
                                                 0};
    ports.freehand = freehand;
    virtual_or = value_or_throw(VirtualDevices::open(ports));
    operation::OperationPlan plan = plan_for(*virtual_or, virtual_or->tracker().port());
    if (options.ct_plan) {
      const std::filesystem::path ct = folder.parent_path() / (folder.filename().string() + "-ct");
      std::filesystem::create_directories(ct);
      plan = with_ct_plan(std::move(plan), virtual_or->simulated_scene().simulated_case(), ct);
    }
    devices = std::make_unique<operation::Connections>(
        plan, value_or_throw(receiver::Inbox::open(folder / "inbox")));
    receiver::ReceiverOptions receiving;
    receiving.port = 0;
    value_or_throw(devices->listen(receiving));
    const auto notify = [say = options.notify](operation::Step step, const std::string& what) {
      say(fmt::format("{}: {}", operation::name_of(step), what));
    };
    using operation::Operation;
    operation =
        value_or_throw(freehand ? Operation::begin_freehand(plan, folder, devices->board(), notify)
                                : Operation::begin(plan, folder, devices->board(), devices->robot(), notify));
    operation->confirmed_by("the rehearsal");
    for (const std::string& view : plan.views)
      value_or_throw(expose(view, *virtual_or, *devices, *operation));
    value_or_throw(operation->measure());
    if (!options.ct_plan) return;
    value_or_throw(operation->register_models());
    value_or_throw(operation->confirm_registration());
  }

  std::unique_ptr<VirtualDevices> virtual_or;
  std::unique_ptr<operation::Connections> devices;
  std::unique_ptr<operation::Operation> operation;
};

/// Until the tunnel's end.
void drill_by_guidance(operation::Operation& operation, virtual_devices::HeldDrill& drill) {
  constexpr double look_s = 0.1;
  const auto until = std::chrono::steady_clock::now() + drilling_patience;
  for (;;) {
    const operation::Guidance shown = value_or_throw(operation.guidance());
    if (shown.aim && shown.aim->depth_mm >= shown.aim->length_mm) return;
    if (std::chrono::steady_clock::now() > until)
      throw BadInput(Reason::off_target, fmt::format("the tunnel was not drilled in {} s; last decision: {}",
                                                     drilling_patience.count(), shown.decision()));
    follow_guidance(shown, drill, look_s);
    std::this_thread::sleep_for(std::chrono::duration<double>(look_s));
  }
}

/// The work on the tunnels. Its end, or the reason why it was stopped, is the record's last line.
template <class Work>
void conduct(operation::Operation& operation, const Work& work) {
  const auto done = guarded(work);
  value_or_throw(operation.finish(done ? std::nullopt : std::optional(done.error())));
  value_or_throw(done);
}

}  // namespace

void follow_guidance(const operation::Guidance& shown, virtual_devices::HeldDrill& drill, double seconds) {
  constexpr double part = 0.5;
  // Slower towards the end: what is shown lags behind the drill.
  constexpr double advance_part = 0.15, least_advance_mm = 0.1, most_advance_mm = 1.5;
  if (!shown.aim) return;
  const operation::TunnelAim& aim = *shown.aim;
  const Eigen::AngleAxisd turn(geometry::rotation_between(Eigen::Vector3d::UnitZ(), aim.axis));
  const double to_end_mm = aim.length_mm - aim.depth_mm;
  const double way_mm = shown.why_not || to_end_mm <= 0
                            ? 0
                            : std::clamp(advance_part * to_end_mm, least_advance_mm, most_advance_mm);
  drill.correct({Eigen::AngleAxisd(part * turn.angle(), turn.axis()).toRotationMatrix(),
                 part * aim.to_axis_mm + way_mm * aim.axis},
                seconds);
}

void raise_drill(const guidance::Bone& bone, virtual_devices::HeldDrill& drill) {
  drill.move(bone, drill.on_tunnel(bone, -40, 4, 5), raise_s);
  std::this_thread::sleep_for(std::chrono::duration<double>(raise_s) + before_exposure);
}

operation::OperationPlan plan_for(VirtualDevices& virtual_or, std::uint16_t tracker_port) {
  operation::OperationPlan plan;
  if (virtual_or.tracker().speaks_ndi()) plan.tracker.address = "ndi:" + plan.tracker.address;
  plan.tracker.port = tracker_port;
  plan.tracker.rate_hz = virtual_or.tracker().rate_hz();
  for (const virtual_devices::TrackedFacet& facet : virtual_devices::calibrator_facets())
    plan.tracker.facets.push_back({facet.name, facet.calibrator_from_facet});
  plan.tracker.sigma_mm = kept_sigma_mm;
  plan.tracker.sigma_deg = kept_sigma_deg;
  if (const robot::VirtualUr* robot = virtual_or.robot_if_any())
    plan.robot = robot_plan(*robot, virtual_or.simulated_scene());
  else
    plan.drill = calibrated_drill(virtual_or.drill());
  // Both tunnels are drilled from outside the joint.
  plan.tunnels = {{"femur", "femur", "FS", "FE", operation::TunnelEnd::end},
                  {"tibia", "tibia", "TS", "TE", operation::TunnelEnd::start}};
  plan.tracker.pointer = operation::Pointer{virtual_devices::pointer_marker, virtual_devices::tip_in_pointer};
  plan.picks = clicks_of(virtual_or.simulated_scene().simulated_case());
  return plan;
}

Expected<Rehearsal> rehearse(std::uint64_t seed, const std::filesystem::path& folder,
                             const RehearsalOptions& options) {
  return guarded([&] {
    const Stage stage(seed, folder, options, false);
    operation::Operation& operation = *stage.operation;
    robot::RobotLink& robot = stage.devices->robot();
    const auto nod = [&](const robot::RobotOrder& order) -> Expected<std::string> {
      return robot.confirm(order);
    };
    value_or_throw(robot.wait_connected(patience));
    value_or_throw(robot.unlock("the rehearsal", robot.status()));
    Rehearsal done{seed, {}};
    const auto again = [&](const Failure& why) {
      return options.plans_again && operation::is_late(why) && ++done.replans > 0;
    };
    conduct(operation, [&] {
      value_or_throw(operation.register_robot(nod, again));
      done.hand_eye_rms_mm = operation.hand_eye().rms_mm;
      if (options.move_bones) stir(stage.virtual_or->simulated_scene());
      std::this_thread::sleep_for(before_exposure);  // until the gate accepts the bones again

      for (const operation::OperationTunnel& tunnel : operation.plan().tunnels) {
        const robot::RobotState rest = value_or_throw(robot.wait_connected(patience));
        std::optional<robot::RobotOrder> begun;  // the tool is on its way by this order, or there
        std::optional<operation::TunnelOutcome> outcome;
        const auto approach = [&] {
          const robot::RobotOrder order = value_or_throw(operation.plan_order(tunnel.name));
          value_or_throw(value_or_throw(operation.live_tool()).overlay(stage.devices->board(), tunnel.bone));
          begun = order;
          outcome = value_or_throw(operation.go(order, robot.confirm(order)));
          add_ends(done, tunnel, *outcome, *stage.virtual_or);
          done.corrections += static_cast<int>(outcome->loop.size()) - 1;
        };
        while (!outcome || begun) {
          const auto moved = guarded([&] {
            if (!begun) return approach();
            value_or_throw(operation.withdraw(*begun, rest, nod));
            begun.reset();
          });
          if (!moved) value_or_throw(operation.plan_again(tunnel.name, moved.error(), again));
        }
      }
    });
    return done;
  });
}

Expected<Rehearsal> rehearse_freehand(std::uint64_t seed, const std::filesystem::path& folder,
                                      const RehearsalOptions& options) {
  return guarded([&] {
    const Stage stage(seed, folder, options, true);
    operation::Operation& operation = *stage.operation;
    virtual_devices::HeldDrill& drill = stage.virtual_or->drill();
    if (options.move_bones) stir(stage.virtual_or->simulated_scene());
    Rehearsal done{seed, {}};
    conduct(operation, [&] {
      for (const operation::OperationTunnel& tunnel : operation.plan().tunnels) {
        raise_drill(tunnel.bone, drill);
        value_or_throw(operation.guide(tunnel.name));
        drill_by_guidance(operation, drill);
        add_ends(done, tunnel, value_or_throw(operation.verify_drilled(tunnel.name)), *stage.virtual_or);
      }
    });
    return done;
  });
}

}  // namespace helicarm::rehearsal
