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

#include "helicarm/case_registration/measure_case.h"
#include "helicarm/devices/receiver/inbox.h"
#include "helicarm/devices/robot/robot_link.h"
#include "helicarm/operation/case_of.h"
#include "helicarm/operation/freehand.h"
#include "helicarm/operation/guidance_gate.h"
#include "helicarm/operation/image_delays.h"
#include "helicarm/operation/live_tool.h"
#include "helicarm/operation/orders.h"
#include "helicarm/operation/plan_watch.h"
#include "helicarm/operation/session_records.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::operation {

/// The steps in their order, which the application shows.
enum class Step { acquire, measure, register_robot, plan, navigate, verify };
std::string_view name_of(Step step);

/// Path of the tip to a tunnel, for a bone at rest.
struct PathPreview {
  std::map<std::string, std::vector<Eigen::Vector2d>> by_view;  ///< in each X-ray image, rectified px (Eq. 6)
  std::vector<Eigen::Vector3d> in_calibrator;                   ///< at the first view's acquisition, mm
};

/// Whether the reading of a pose failed, so that another one may help.
bool is_of_a_reading(const Failure& why);

/// Whether poses, robot states or heartbeats came later than their limit: the robot is stopped, and nothing
/// else is known to be wrong.
bool is_late(const Failure& why);

/// One operation from the first X-ray image to verification, on connected devices. Each decision is written
/// to the session log with its inputs before it takes effect; a failed write stops the operation, and so does
/// the loss of the log (record_lost), also during a motion. Call members from one thread, except `interrupt`.
class Operation {
 public:
  /// Called at the beginning of each step and with its outcome.
  using Notify = std::function<void(Step, const std::string& what)>;

  /// Writes session.log and one folder per measurement into `folder`.
  static Expected<std::unique_ptr<Operation>> begin(
      OperationPlan plan, const std::filesystem::path& folder, const tracker::PoseBoard& board,
      robot::RobotLink& robot, Notify notify = [](Step, const std::string&) {});
  /// For a plan with a hand-held drill: members that need a robot refuse (usage).
  static Expected<std::unique_ptr<Operation>> begin_freehand(
      OperationPlan plan, const std::filesystem::path& folder, const tracker::PoseBoard& board,
      Notify notify = [](Step, const std::string&) {});

  const OperationPlan& plan() const { return plan_; }
  /// Name of the person who confirms orders from now on; goes into the session log.
  void confirmed_by(std::string who) { who_ = std::move(who); }
  /// Ends every wait for the tracker with `interrupted`, permanently; from any thread.
  void interrupt() { end_.request_stop(); }
  /// Records the end of the operation, and why it did not succeed. Without effect after the first call.
  Expected<void> finish(const std::optional<Failure>& why = {});
  /// Whether the record of the operation is still in its place (record_lost); poll it while a confirmation is
  /// open. From any thread.
  Expected<void> recorded() const { return log_->intact(); }
  /// Views without an image, in the plan's order.
  std::vector<std::string> views_to_come() const;

  /// A check point is touched before the first image and again before each order to a tunnel in its bone. The
  /// first touch records its position; later ones return the tip's distance from it, mm, and refuse
  /// residual_too_large above its limit: marker and bone no longer correspond; plans and guidance to the bone
  /// end, and a new operation is required. Refuses as `touched_in_bone`, and a first touch after an image
  /// (usage).
  Expected<double> touch(const std::string& check_point);
  /// Check points to touch before this tunnel is planned.
  std::vector<std::string> checks_to_come(const guidance::Bone& bone) const;

  /// Accepts an image: dates it by its arrival (monotonic seconds) and averages the poses of all markers over
  /// the acquisition window. The positioner angle decides the view, else `view`. Refuses as
  /// `poses_of_exposure`; a tunnel's bone that was not visible (no_pose); an image received before or delayed
  /// in the C-arm, whose poses are unknown (stale_pose); an image of another view (views_too_close) or
  /// another patient (patient_mismatch); a file that changed since its arrival (image_changed). An earlier
  /// image found to be delayed must be acquired again.
  Expected<void> take(const std::string& view, const receiver::Arrival& arrival, double arrival_s);

  /// The accepted images by view.
  std::map<std::string, std::filesystem::path> images() const;

  /// They replace those of the plan.
  void pick(std::vector<pipeline::Pick> picks) { plan_.picks = std::move(picks); }

  /// Rectifies, calibrates, locates; fails with the refusal of the case, and (image_changed) if an image is
  /// no longer the one that was received. The calibration is kept until the next image.
  Expected<void> measure();
  const pipeline::Result& result() const { return *result_; }
  bool is_measured() const { return result_.has_value(); }
  /// Of `result`; nothing without a measurement of the present images.
  const std::optional<pipeline::Case>& measured_case() const { return measured_case_; }
  /// The last measurement, also a refused one.
  const std::optional<pipeline::Result>& newest_result() const { return newest_result_; }
  /// The result with the comparisons of the tool with the tunnels reached so far (Eq. 17), and the
  /// registration: as of a case, for a report. Refuses (usage) without a measurement of the present images.
  Expected<case_registration::Measurement> measurement() const;
  /// Number of calibrations.
  int calibrations() const { return calibrations_; }
  /// Of `register_models` that came to an end, refused ones too.
  int registrations() const { return registrations_; }
  /// Poses at each view's acquisition, in the plan's order.
  std::vector<guidance::Poses> exposures() const;

  /// Registers the plan's models to the measured images; the report and an overlay of each view are then in
  /// the session's folder. `starts`: of models that a person moved, instead of the plan's. Takes seconds to
  /// minutes; `interrupt` ends it, and so does what `check` throws, which is called often, from other
  /// threads. Fails with the refusal of a model; where it ends before that, the earlier registration stays.
  /// Until `confirm_registration` it guides nothing (registration_not_confirmed), nor after further images or
  /// another measurement (registration_stale).
  Expected<void> register_models(
      const std::vector<ModelStart>& starts = {}, const std::function<void()>& check = [] {});
  /// The last registration of the present images, also a refused one.
  const std::optional<case_registration::CaseRegistration>& registration() const { return registration_; }
  /// By `confirm_registration`, that registration.
  bool is_confirmed() const { return gate_.is_confirmed(); }
  /// After a person has compared the outlines with the bones in the images. Refuses (usage) without a
  /// registration, and as the registration was refused.
  Expected<void> confirm_registration();

  /// The moves that `register_robot` would make from the present pose, in order. Nothing moves.
  Expected<std::vector<robot::RobotOrder>> preview_tour() const;
  /// Moves the tool through small rotations and estimates the transforms between marker, robot and tracker.
  /// Calls `confirm` for the token of each move. A move that is stopped is planned anew as `plan_again`.
  using Confirm = std::function<Expected<std::string>(const robot::RobotOrder&)>;
  /// Asks whoever gives orders whether to unlock the robot and plan again after this refusal.
  using Again = std::function<bool(const Failure&)>;
  Expected<void> register_robot(
      const Confirm& confirm, const Again& again = [](const Failure&) { return false; });
  const tracker::HandEye& hand_eye() const { return *hand_eye_; }

  /// The order that moves the tool to the tunnel, with its preview, also written as preview-TUNNEL-VIEW.png
  /// into the session's folder. Nothing moves. Refuses (usage) a bone whose check points were not touched
  /// since the last order, (plan_stale) a robot whose base or tool moved since registration, and (uncertain)
  /// an end whose 95 % error at the tool's tip exceeds the plan's limit.
  Expected<robot::RobotOrder> plan_order(const std::string& tunnel);
  /// Whether this order may be carried out at the newest poses; poll it while the confirmation is open.
  /// Refuses as `PlanWatch::holds`, and (plan_stale) an order that is not the last plan to its tunnel. A plan
  /// once found stale stays stale, and its check points must be touched again.
  Expected<void> check_plan(const robot::RobotOrder& order);
  /// Performs the same check from any thread, without a record. Refuses (usage) an order that was not
  /// planned.
  Expected<PlanWatch> plan_watch(const robot::RobotOrder& order) const;
  /// Whether this order is the last plan to its tunnel.
  bool is_planned(const robot::RobotOrder& order) const { return gate_.is_planned(order); }
  Expected<PathPreview> preview(const robot::RobotOrder& order) const;

  /// Follows the tool from any thread. Refuses (usage) before measurement and registration.
  Expected<LiveTool> live_tool() const;

  /// Carries out the confirmed order with corrections by the tracker, and verifies the result in the X-ray
  /// images. Refuses as `check_plan`, which also stops the robot during the move, and (uncertain) an end
  /// point whose predicted error exceeds the plan's limit.
  Expected<TunnelOutcome> go(const robot::RobotOrder& order, const std::string& token);

  /// After an order to this tunnel was refused or stopped: asks `again`, records that a new plan follows and
  /// unlocks the robot. Nothing moves before that plan is made and confirmed as the first one. Refuses with
  /// `why` itself if that is neither of poses (plan_stale, no_pose, stale_pose, pose_spread) nor late
  /// (`is_late`) on a link that answers again within 2 s, after `most_replans`, and without consent. Refuses,
  /// before `again` and after it, a robot that has stopped by itself (robot_stopped), a lost link
  /// (not_connected), and any other stop since it asked, whatever `why` is; the record holds them.
  Expected<void> plan_again(const std::string& order, const Failure& why, const Again& again);

  /// Retreats along the tool's axis to the stand-off distance, then moves to the tool's initial pose
  /// (`rest`). Planned at the present poses, so also after a stop, once a person has unlocked the robot, and
  /// after further images, which end a registration: the way out of the bone stays open.
  Expected<void> withdraw(const robot::RobotOrder& order, const robot::RobotState& rest,
                          const Confirm& confirm);

  /// Begins to guide a hand-held drill to a tunnel, at the poses of the next 0.75 s. Refuses (usage) before
  /// the measurement and before the bone's check points were touched; not_seen for a tunnel that is not
  /// located; no_pose. `oldest_pose_s`: limit of a pose's age instead of the tracker's.
  Expected<void> guide(const std::string& tunnel, std::optional<double> oldest_pose_s = {});
  /// The drill at the newest poses. A new decision is recorded with its samples before it is returned. Once
  /// plan_stale, it stays so until `guide` is called again, and check points must be touched again. Refuses
  /// (usage) before `guide`, and (record_lost) without the log, which ends the guidance.
  Expected<Guidance> guidance();
  /// Compares the drill, held still in the drilled tunnel or along it, with the tunnel in the tracker's frame
  /// and in the X-ray images. Ends its guidance, which goes on as it was begun where this is refused:
  /// off_target (the drill is not there), plan_stale (as guided), usage (another tunnel is guided), and as a
  /// reading of poses.
  Expected<TunnelOutcome> verify_drilled(const std::string& tunnel);
  /// By the person. It has ended also where its record fails (record_lost).
  Expected<void> end_guidance();

 private:
  static constexpr std::chrono::seconds robot_patience{5};

  struct View {
    std::string name;
    std::filesystem::path image;
    std::string digest;  ///< of the file when it was received
    xray::Acquisition acquisition;
    double arrival_s;
    guidance::Poses poses;
  };

  Operation(OperationPlan plan, std::filesystem::path folder, const tracker::PoseBoard& board,
            robot::RobotLink* robot, Notify notify)
      : plan_(std::move(plan)),
        folder_(std::move(folder)),
        board_(board),
        robot_(robot),
        notify_(std::move(notify)) {}

  static Expected<std::unique_ptr<Operation>> begin(OperationPlan plan, const std::filesystem::path& folder,
                                                    const tracker::PoseBoard& board, robot::RobotLink* robot,
                                                    Notify notify);
  // operation.cc
  robot::RobotLink& robot() const;
  TrackedTool tool() const;
  const OperationTunnel& tunnel_named(const std::string& name) const;
  void record(const Record& what);
  void record_halt(const std::string& order, const Failure& why);
  PoseWindow look(record::Look why);
  pipeline::Result run(const guidance::Poses& now, const std::vector<guidance::ToolLine>& tool_lines);
  // What is forgotten is not in force any more: its caller records last that the guidance has ended with it.
  [[nodiscard]] std::optional<record::GuidanceEnded> forget_measurement();
  [[nodiscard]] std::optional<record::GuidanceEnded> forget_result();
  tracker::HandEyePair pair_at(const geometry::RigidTransform& base_from_tcp, const Confirm& confirm);
  std::vector<robot::Miss> carry_out(const robot::RobotOrder& order, const std::string& token,
                                     const robot::Measure& measure, const robot::Watch& watch);
  TunnelOutcome check(const OperationTunnel& tunnel);
  void draw_preview(const robot::RobotOrder& order);

  // guide_drill.cc
  TunnelAim aim_at(const OperationTunnel& tunnel);
  void end_guidance(record::GuidanceEndedBy by);
  std::optional<record::GuidanceEnded> guidance_ended(record::GuidanceEndedBy by) const;
  void record_ended(const std::optional<record::GuidanceEnded>& ended);

  // acquire.cc
  xray::Acquisition acquisition_of(std::string& view, const receiver::Arrival& arrival, double arrival_s);
  void refuse_other_views(const std::string& view, const xray::Acquisition& shown) const;
  void weigh_delay(const std::string& view, const xray::Acquisition& shown, double arrival_s);
  double held_s(const xray::Acquisition& shown, double arrival_s) const;
  std::optional<std::string> inbox_of(const std::filesystem::path& image) const;
  void notify_once(const std::string& warning);

  // register_plan_models.cc
  [[nodiscard]] std::optional<record::GuidanceEnded> forget_registration();

  // fresh_plan.cc, plan_again.cc
  robot::Watch sees_tool() const;
  robot::Watch in_place(PlanWatch watch) const;
  void end_plans_to(const guidance::Bone& bone, const Failure& why);
  /// Throws as the check point that was refused.
  void check_not_displaced(const guidance::Bone& bone) const;
  /// Without `points_in_bone`.
  PlanBasis basis_of(const OperationTunnel& tunnel, const PoseWindow& window,
                     const robot::RobotState& present) const;
  bool answers_again() const;
  /// Records why no new plan follows, and throws it.
  [[noreturn]] void halt(const std::string& order, const Failure& why);
  /// As `halt`, after a stop of the robot itself or with a lost link.
  void halt_if_no_plan_helps(const std::string& order, const robot::RobotLinkStatus& now);

  OperationPlan plan_;
  std::filesystem::path folder_;
  const tracker::PoseBoard& board_;
  robot::RobotLink* robot_;  ///< null for a hand-held drill
  Notify notify_;
  std::stop_source end_;
  std::unique_ptr<SessionLog> log_;
  bool finished_ = false;
  std::string who_ = "unknown";
  std::vector<View> views_;
  ImageDelays delays_;
  std::set<std::string> reported_;
  std::map<std::string, Eigen::Vector3d> touched_in_bone_;  ///< first touch of each check point
  std::set<std::string> in_place_;               ///< check points touched since the last image and order
  std::map<guidance::Bone, Failure> displaced_;  ///< whose marker a check point has refused
  int case_folders_ = 0;                         ///< written so far
  PlanFiles files_;
  std::optional<pipeline::Result> by_images_;  ///< of the present images
  int calibrations_ = 0, registrations_ = 0;
  std::optional<pipeline::Case> measured_case_;  ///< of the last measurement, not of a verification
  std::optional<case_registration::CaseRegistration> registration_;  ///< of `measured_`
  std::string registered_digest_;
  std::optional<pipeline::Result> result_, newest_result_;
  std::optional<pipeline::Result> without_models_;  ///< `result_` as measured
  std::optional<tracker::HandEye> hand_eye_;
  GuidanceGate gate_;
  std::map<std::string, int> replans_;                                ///< by order
  std::map<std::string, guidance::Verification> verifications_ = {};  ///< by tunnel, of the present images
};

}  // namespace helicarm::operation
