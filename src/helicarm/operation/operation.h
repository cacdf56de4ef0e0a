// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "helicarm/devices/receiver/inbox.h"
#include "helicarm/devices/robot/robot_link.h"
#include "helicarm/operation/image_delays.h"
#include "helicarm/operation/live_tool.h"
#include "helicarm/operation/plan_watch.h"
#include "helicarm/pipeline/calibration_cache.h"
#include "helicarm/session/session_log.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm {

/// The steps in the order in which they are taken (the application shows them so).
enum class Step { acquire, measure, register_robot, plan, navigate, verify };
std::string_view name_of(Step step);

/// How a tool stands to its tunnel after the robot went there.
struct TunnelOutcome {
  std::string tunnel;
  std::vector<Miss> loop;  ///< the closed loop's measurements, the last one within its tolerance
  EndMiss start;           ///< across the tool's axis, by tracker and X-rays
  EndMiss end;
  std::optional<Verification> verification;  ///< Eq. 17 in the X-rays
};

/// The tip's way to a tunnel, had its bone stayed where it was.
struct PathPreview {
  std::map<std::string, std::vector<Eigen::Vector2d>> by_view;  ///< in each X-ray, rectified pixels (Eq. 6)
  std::vector<Eigen::Vector3d> in_calibrator;                   ///< at the first view's exposure, mm
};

/// One operation from the first X-ray to the last check, over devices that are already connected. Every
/// decision, with all that led to it, is in the session's record before anything follows from it; a record
/// that cannot be written stops the operation. Members are called from one thread, but for `interrupt`.
class Operation {
 public:
  /// Told each step as it begins and what came of it, for whoever watches.
  using Notify = std::function<void(Step, const std::string& what)>;

  /// `folder` takes session.log and a folder for each measurement.
  static Expected<std::unique_ptr<Operation>> begin(
      OperationPlan plan, const std::filesystem::path& folder, const PoseBoard& board, RobotLink& robot,
      Notify notify = [](Step, const std::string&) {});

  const OperationPlan& plan() const { return plan_; }
  /// Who confirms orders from now on, for the record.
  void confirmed_by(std::string who) { who_ = std::move(who); }
  /// Ends what waits for the tracker, with `interrupted`, for good; from any thread.
  void interrupt() { end_.request_stop(); }
  /// Says in the record that the operation came to its end.
  Expected<void> finish();
  /// Views that still want an image, in the plan's order.
  std::vector<std::string> views_to_come() const;

  /// Check points are touched before the first image, and again before each order to a tunnel in their
  /// bone. The first time learns where it is; then gives how far off the tip is, mm, and refuses
  /// residual_too_large over its limit: then marker and bone are no longer what they were, and only a new
  /// operation helps. Refuses as `touched_in_bone`, and a first touch after an image (usage).
  Expected<double> touch(const std::string& check_point);
  /// Those that must be touched before this tunnel is planned.
  std::vector<std::string> checks_to_come(Bone bone) const;

  /// Acquire: dates the image by its arrival (monotonic seconds) and takes everything's pose for it; as the
  /// view that its positioner's angle names, else as this one. Refuses as `poses_of_exposure`, a tunnel's
  /// bone that was not seen (no_pose), an image that came before or was held back in the C-arm (stale_pose:
  /// nobody knows where things were), that is another view's (views_too_close), or another patient's
  /// (patient_mismatch). An earlier image that turns out to have been held back is to come again.
  Expected<void> take(const std::string& view, const Arrival& arrival, double arrival_s);

  /// The images that were taken, by view.
  std::map<std::string, std::filesystem::path> images() const;

  /// Picks as in case.json, in place of the plan's.
  void pick(Json picks) { plan_.picks = std::move(picks); }

  /// Rectify, calibrate, locate; fails with what the case was refused for. The calibration is held until
  /// another image is taken.
  Expected<void> measure();
  const Result& result() const { return *result_; }
  /// The last measurement, also one that was refused.
  const std::optional<Result>& newest_result() const { return newest_; }
  /// How many times the views were calibrated.
  int calibrations() const { return cache_.calibrations(); }
  /// What the tracker said at each view's exposure, in the plan's order.
  std::vector<Poses> exposures() const;

  /// The moves that `register_robot` would make from here, in their order. Nothing moves.
  Expected<std::vector<RobotOrder>> preview_tour() const;
  /// Moves the tool a little to all sides and learns how marker, robot and tracker stand to each other. Asks
  /// `confirm` for each move's token.
  using Confirm = std::function<Expected<std::string>(const RobotOrder&)>;
  Expected<void> register_robot(const Confirm& confirm);
  const HandEye& hand_eye() const { return *hand_eye_; }

  /// The order that brings the tool to the tunnel, and what it will look like: also as
  /// preview-TUNNEL-VIEW.png in the session's folder. Nothing moves. Refuses (usage) a bone whose check
  /// points were not touched since the last order, and (plan_stale) a robot whose base or tool moved since it
  /// was registered.
  Expected<RobotOrder> plan_tunnel(const std::string& tunnel);
  /// Whether this order may still be carried out, by the newest poses: to be asked while its confirmation is
  /// open. Refuses as `PlanWatch::holds`, and (plan_stale) an order that is not its tunnel's last plan. A
  /// plan that was found stale once remains so.
  Expected<void> check_plan(const RobotOrder& order);
  /// What answers the same in any thread, without a record. Refuses (usage) an order that was not planned.
  Expected<PlanWatch> plan_watch(const RobotOrder& order) const;
  Expected<PathPreview> preview(const RobotOrder& order) const;

  /// What follows the tool from now on, in any thread. Refuses (usage) before measuring and registering.
  Expected<LiveTool> live_tool() const;

  /// Carries the confirmed order out, corrected by the tracker, and checks the result in the X-rays. Refuses
  /// as `check_plan`, which stops the robot on its way, too, and (uncertain) an end whose predicted error is
  /// over the plan's limit.
  Expected<TunnelOutcome> go(const RobotOrder& order, const std::string& token);

  /// Back along the tool's axis until it is as far as the stand-off, and from there to where the tool was
  /// (`rest`). Planned on the poses of now: also after a stop, once a person has unlocked the robot.
  Expected<void> withdraw(const RobotOrder& order, const RobotState& rest, const Confirm& confirm);

 private:
  static constexpr std::chrono::seconds robot_patience{5};

  struct View {
    std::string name;
    std::filesystem::path image;
    Acquisition acquisition;
    double arrival_s;
    Poses poses;
  };

  struct Planned {
    std::string order;  ///< its text: what is confirmed must be this
    RigidTransform bone_from_target;
    PlanWatch watch;
    std::optional<Failure> stale = {};  ///< once it was found so
  };

  Operation(OperationPlan plan, std::filesystem::path folder, const PoseBoard& board, RobotLink& robot,
            Notify notify)
      : plan_(std::move(plan)),
        folder_(std::move(folder)),
        board_(board),
        robot_(robot),
        notify_(std::move(notify)) {}

  const PlannedTunnel& tunnel_named(const std::string& name) const;
  void record(const std::string& kind, Json content);
  PoseWindow look(const char* why);
  Acquisition acquisition_of(std::string& view, const Arrival& arrival, double arrival_s);
  void refuse_other_views(const std::string& view, const Acquisition& shown) const;
  void weigh_delay(const std::string& view, const Acquisition& shown, double arrival_s);
  double held_s(const Acquisition& shown, double arrival_s) const;
  void told_once(const std::string& warning);
  Watch sees_tool() const;
  Watch in_place(PlanWatch watch) const;
  PlanBasis basis_of(const PlannedTunnel& tunnel, const PoseWindow& window, const RobotState& present) const;
  const Planned& planned(const RobotOrder& order) const;
  void record_halt(const RobotOrder& order, const Failure& why);
  Result run(const Poses& now, const std::vector<ToolLine>& tool_lines);
  std::vector<Miss> carry_out(const RobotOrder& order, const std::string& token, const Measure& measure,
                              const Watch& watch);
  TunnelOutcome check(const PlannedTunnel& tunnel);
  void draw_preview(const RobotOrder& order) const;

  OperationPlan plan_;
  std::filesystem::path folder_;
  const PoseBoard& board_;
  RobotLink& robot_;
  Notify notify_;
  std::stop_source end_;
  std::unique_ptr<SessionLog> log_;
  std::string who_ = "unknown";
  std::vector<View> views_;
  ImageDelays delays_;
  std::set<std::string> reported_;
  std::map<std::string, Eigen::Vector3d> touched_in_bone_;  ///< each check point the first time
  std::set<std::string> in_place_;  ///< check points touched again since the last order
  int measurements_ = 0;
  CalibrationCache cache_;
  std::optional<Result> result_, newest_;
  std::optional<HandEye> hand_eye_;
  std::map<std::string, Planned> planned_;  ///< by tunnel
};

}  // namespace helicarm
