// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/operation.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/private_files.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/operation/case_of.h"
#include "helicarm/operation/hand_eye_tour.h"
#include "helicarm/operation/models.h"
#include "helicarm/report/overlay.h"
#include "helicarm/xray/digest.h"

namespace helicarm::operation {
namespace fs = std::filesystem;

namespace {

/// Spacing of the tip's drawn positions, mm.
constexpr double preview_step_mm = 5;

/// A path is planned with the robot base found at registration.
Expected<void> refuse_moved_base(const tracker::HandEye& registered, const PlanBasis& basis,
                                 const robot::RobotState& present, const PlanLimits& limits) {
  return check_motion(
      "robot base or tool",
      motion_of(present.base_from_tcp.translation, registered.tracker_from_base, basis.tracker_from_base),
      limits, "registration", "register the robot again");
}

}  // namespace

std::string_view name_of(Step step) {
  constexpr std::array names{"acquire", "measure", "register", "plan", "navigate", "verify"};
  return names[std::size_t(step)];
}

Expected<std::unique_ptr<Operation>> Operation::begin(OperationPlan plan, const fs::path& folder,
                                                      const tracker::PoseBoard& board,
                                                      robot::RobotLink& robot, Notify notify) {
  return begin(std::move(plan), folder, board, &robot, std::move(notify));
}

Expected<std::unique_ptr<Operation>> Operation::begin_freehand(OperationPlan plan, const fs::path& folder,
                                                               const tracker::PoseBoard& board,
                                                               Notify notify) {
  if (!plan.drill) return fail(Reason::bad_value, "the plan has no \"drill\"");
  return begin(std::move(plan), folder, board, nullptr, std::move(notify));
}

robot::RobotLink& Operation::robot() const {
  if (!robot_) throw BadInput(Reason::usage, "the plan has a hand-held drill and no robot");
  return *robot_;
}

TrackedTool Operation::tool() const {
  if (plan_.drill) return tracked_tool(*plan_.drill);
  if (!hand_eye_) throw BadInput(Reason::usage, "the robot is not registered; register it first");
  return tracked_tool(*hand_eye_, plan_.robot.tool);
}

Expected<std::unique_ptr<Operation>> Operation::begin(OperationPlan plan, const fs::path& folder,
                                                      const tracker::PoseBoard& board,
                                                      robot::RobotLink* robot, Notify notify) {
  return guarded([&] {
    value_or_throw(plan_from(to_json(plan), "plan", plan.folder));  // as its record will be read
    std::unique_ptr<Operation> operation(
        new Operation(std::move(plan), folder, board, robot, std::move(notify)));
    value_or_throw(make_private_folder(folder));
    operation->log_ = value_or_throw(SessionLog::open(folder / "session.log"));
    if (operation->log_->history().records.size() > 1)
      throw BadInput(Reason::cannot_write,
                     fmt::format("{}: already holds the record of another operation; choose an empty folder",
                                 folder.string()));
    operation->files_ = value_or_throw(files_of(operation->plan_));
    const Digests models = value_or_throw(keep_models(operation->plan_, folder));
    operation->record(record::Plan{operation->plan_});
    if (!models.empty()) operation->record(record::Models{"models", models});
    return operation;
  });
}

std::vector<std::string> Operation::views_to_come() const {
  std::vector<std::string> names = plan_.views;
  std::erase_if(names, [&](const std::string& name) {
    return std::ranges::find(views_, name, &View::name) != views_.end();
  });
  return names;
}

void Operation::record(const Record& what) {
  value_or_throw(log_->append(std::string(kind_of(what)), content_of(what)));
}

PoseWindow Operation::look(record::Look why) {
  PoseWindow window = window_now(board_, plan_.tracker, end_.get_token());
  record(record::Poses{why, window});
  return window;
}

void Operation::record_halt(const std::string& order, const Failure& why) {
  record(record::Halted{order, std::string(code(why.reason)), why.message, why.figures});
}

std::vector<robot::Miss> Operation::carry_out(const robot::RobotOrder& order, const std::string& token,
                                              const robot::Measure& measure, const robot::Watch& watch) {
  const record::Confirmed confirmed{order.name, xray::digest(to_text(robot::to_json(order))), who_};
  record(confirmed);
  auto misses = robot().execute(order, token, measure, watch);
  if (!misses) {
    // The first reason is reported, also where it cannot be recorded.
    static_cast<void>(guarded([&] { record_halt(order.name, misses.error()); }));
    throw BadInput(misses.error());
  }
  record(record::CarriedOut{confirmed});
  return *std::move(misses);
}

Expected<void> Operation::finish(const std::optional<Failure>& why) {
  return guarded([&] {
    if (std::exchange(finished_, true)) return;
    const auto guidance = guarded([&] { end_guidance(record::GuidanceEndedBy::operation); });
    const auto end = guarded([&] {
      record(why ? record::End{std::string(code(why->reason)), why->message} : record::End{});
    });
    value_or_throw(guidance);
    value_or_throw(end);
  });
}

pipeline::Result Operation::run(const guidance::Poses& now,
                                const std::vector<guidance::ToolLine>& tool_lines) {
  newest_result_.reset();
  const std::string name = fmt::format("case-{}", ++case_folders_);
  std::vector<CaseImage> images;
  for (const View& view : views_) images.push_back({view.name, view.image, view.digest, view.poses});
  std::vector<guidance::ToolLine> of_picks, of_models;
  for (const guidance::ToolLine& line : tool_lines)
    (tunnel_named(line.tunnel).of_model ? of_models : of_picks).push_back(line);
  const pipeline::Case the_case =
      value_or_throw(operation_case(folder_ / name, plan_, files_, images, now, of_picks));
  const Digests files = value_or_throw(write_operation_case(the_case, files_, images));
  record(record::CaseBegun{name, pipeline::to_json(the_case), files,
                           tool_lines.empty() ? std::string() : tool_lines.front().tunnel});
  const auto earlier = by_images_ ? by_images_->calibration : nullptr;
  by_images_ = value_or_throw(measure_by_plan(the_case, plan_, by_images_));
  if (by_images_->calibration != earlier || !earlier) ++calibrations_;
  pipeline::Result result = *by_images_;
  if (gate_.is_confirmed() && !result.failure)
    result = value_or_throw(with_registration(result, *registration_, plan_, the_case, of_models));
  if (!tool_lines.empty()) add_depths(plan_, tool(), result);
  const Digests written = value_or_throw(write_result(result, the_case.folder));
  value_or_throw(check_digests(the_case.folder, files));
  record(record::Measured{name, digest_of(pipeline::to_json(result)), written});
  if (tool_lines.empty()) measured_case_ = the_case;
  newest_result_ = std::move(result);
  if (newest_result_->failure) throw BadInput(*newest_result_->failure);
  return *newest_result_;
}

/// The images are others now.
std::optional<record::GuidanceEnded> Operation::forget_measurement() {
  const auto ended = forget_result();
  measured_case_.reset();
  by_images_.reset();
  return ended;
}

/// What was planned, guided, registered and verified by it ends too.
std::optional<record::GuidanceEnded> Operation::forget_result() {
  const auto ended = guidance_ended(record::GuidanceEndedBy::new_plan);
  static_cast<void>(forget_registration());  // its end too
  gate_.forget_plans();
  result_.reset();
  without_models_.reset();
  newest_result_.reset();
  verifications_.clear();
  return ended;
}

Expected<void> Operation::measure() {
  return guarded([&] {
    if (const auto missing = views_to_come(); !missing.empty())
      throw BadInput(Reason::usage, fmt::format("{}: no image received; acquire this view", missing.front()));
    notify_(Step::measure, fmt::format("{} views", views_.size()));
    record_ended(forget_result());
    result_ = without_models_ = run({}, {});
  });
}

Expected<std::vector<robot::RobotOrder>> Operation::preview_tour() const {
  return guarded([&] {
    const robot::RobotState present = value_or_throw(robot().wait_connected(robot_patience));
    std::vector<robot::RobotOrder> orders;
    for (const geometry::RigidTransform& pose : hand_eye_tour(present.base_from_tcp))
      orders.push_back(tour_order(plan_.robot, present, pose));
    return orders;
  });
}

/// Moves the tool there and looks at it.
tracker::HandEyePair Operation::pair_at(const geometry::RigidTransform& pose, const Confirm& confirm) {
  const robot::RobotState present = value_or_throw(robot().wait_connected(robot_patience));
  const robot::RobotOrder order = tour_order(plan_.robot, present, pose);
  const PlanWatch age(plan_.limits, plan_.tracker, {.time_s = tracker::monotonic_seconds()});
  record(record::Robot{present.joints});
  record(record::Order::of(order));
  const std::string token = value_or_throw(confirm(order));
  value_or_throw(age.young(tracker::monotonic_seconds()));
  carry_out(order, token, {}, sees_tool());
  const SeenPose seen =
      value_or_throw(see_tool(look(record::Look::hand_eye), plan_.tracker, plan_.tracker.tool));
  const robot::RobotState at_rest = value_or_throw(robot().wait_connected(robot_patience));
  return {at_rest.base_from_tcp * plan_.robot.tool.flange_from_tcp.inverse(), seen.tracker_from_marker};
}

Expected<void> Operation::register_robot(const Confirm& confirm, const Again& again) {
  return guarded([&] {
    notify_(Step::register_robot, "hand-eye calibration");
    std::vector<tracker::HandEyePair> pairs;
    const robot::RobotState begin = value_or_throw(robot().wait_connected(robot_patience));
    const std::vector<geometry::RigidTransform> tour = hand_eye_tour(begin.base_from_tcp);
    record(record::Tour{begin.base_from_tcp});
    while (pairs.size() < tour.size()) {
      const auto pair = guarded([&] { return pair_at(tour[pairs.size()], confirm); });
      if (!pair) {
        value_or_throw(plan_again(tour_name, pair.error(), again));
        continue;
      }
      pairs.push_back(*pair);
      notify_(Step::register_robot, fmt::format("pose {} of {}", pairs.size(), tour.size()));
    }
    const tracker::HandEye found = value_or_throw(tracker::calibrate_hand_eye(pairs));
    record(record::HandEye{pairs, found});
    hand_eye_ = found;
  });
}

const OperationTunnel& Operation::tunnel_named(const std::string& name) const {
  const auto tunnel = std::ranges::find(plan_.tunnels, name, &OperationTunnel::name);
  if (tunnel == plan_.tunnels.end())
    throw BadInput(Reason::bad_value, fmt::format("{}: is not a tunnel of the plan", name));
  return *tunnel;
}

Expected<robot::RobotOrder> Operation::plan_order(const std::string& name) {
  return guarded([&] {
    const OperationTunnel& tunnel = tunnel_named(name);
    check_not_displaced(tunnel.bone);
    if (const auto missing = checks_to_come(tunnel.bone); !missing.empty())
      throw BadInput(Reason::usage, fmt::format("{}: touch this check point first", missing.front()));
    if (!result_) throw BadInput(Reason::usage, "no measurement yet");
    value_or_throw(gate_.check_registered(tunnel));
    if (!hand_eye_) throw BadInput(Reason::usage, "the robot is not registered; register it first");
    notify_(Step::plan, name);
    const PoseWindow window = look(record::Look::plan);
    const guidance::Poses now = value_or_throw(poses_now(window, plan_.tracker));
    value_or_throw(check_error_at_tip(plan_, tunnel, *result_, now, tool()));
    const robot::RobotState present = value_or_throw(robot().wait_connected(robot_patience));
    PlanBasis basis = basis_of(tunnel, window, present);
    const TunnelInBone ends = value_or_throw(tunnel_in_bone(*result_, tunnel));
    basis.points_in_bone = {ends.enter, ends.leave};
    value_or_throw(refuse_moved_base(*hand_eye_, basis, present, plan_.limits));
    robot::RobotOrder order =
        value_or_throw(tunnel_order(plan_, tunnel, *result_, *hand_eye_, now, present.joints));
    gate_.plan(name, {to_text(robot::to_json(order)), target_in_bone(order, tunnel.bone, now, *hand_eye_),
                      PlanWatch(plan_.limits, plan_.tracker, basis)});
    record(record::Robot{present.joints});
    record(record::Order::of(order));
    draw_preview(order);
    return order;
  });
}

void Operation::draw_preview(const robot::RobotOrder& order) {
  const PathPreview path = value_or_throw(preview(order));
  Digests files;
  for (std::size_t i = 0; i < views_.size(); ++i)
    if (const auto shown = path.by_view.find(views_[i].name); shown != path.by_view.end()) {
      const std::string name = fmt::format("preview-{}-{}.png", order.name, views_[i].name);
      const std::string png = report::overlay_png(*result_, i, shown->second);
      value_or_throw(write_private_file(folder_ / name, png));
      files[name] = xray::digest(png);
    }
  record(record::Preview{order.name, files});
}

std::map<std::string, fs::path> Operation::images() const {
  std::map<std::string, fs::path> images;
  for (const View& view : views_) images[view.name] = view.image;
  return images;
}

std::vector<guidance::Poses> Operation::exposures() const {
  std::vector<guidance::Poses> poses;
  for (const View& view : views_) poses.push_back(view.poses);
  return poses;
}

Expected<LiveTool> Operation::live_tool() const {
  return guarded([&] {
    if (!result_) throw BadInput(Reason::usage, "no measurement yet");
    return LiveTool(plan_, *result_, exposures(), tool());
  });
}

Expected<PathPreview> Operation::preview(const robot::RobotOrder& order) const {
  return guarded([&] {
    if (!result_) throw BadInput(Reason::usage, "no measurement yet");
    PathPreview preview;
    const OperationTunnel& tunnel = tunnel_named(order.name);
    const geometry::RigidTransform bone_from_base =
        value_or_throw(gate_.planned(order.name)).bone_from_target *
        order.waypoints.back().base_from_tcp.inverse();
    std::vector<Eigen::Vector3d> tips_in_bone;
    for (std::size_t i = 1; i < order.waypoints.size(); ++i) {
      const Eigen::Vector3d from = order.waypoints[i - 1].base_from_tcp.translation;
      const Eigen::Vector3d way = order.waypoints[i].base_from_tcp.translation - from;
      const int steps = std::max(1, static_cast<int>(way.norm() / preview_step_mm));
      for (int step = 0; step <= steps; ++step)
        tips_in_bone.push_back(bone_from_base * (from + way * step / steps));
    }
    for (const View& view : views_) {
      const auto shown = std::ranges::find(result_->views, view.name, &pipeline::ViewResult::name);
      const auto calibrator_from_bone = guidance::calibrator_from(tunnel.bone, view.poses);
      if (shown == result_->views.end() || !shown->calibrated || !calibrator_from_bone) continue;
      std::vector<Eigen::Vector2d>& path = preview.by_view[view.name];
      for (const Eigen::Vector3d& tip_in_bone : tips_in_bone) {
        const Eigen::Vector3d tip = *calibrator_from_bone * tip_in_bone;
        if (&view == &views_.front()) preview.in_calibrator.push_back(tip);
        if (shown->calibrated->view.depth(tip) > 0) path.push_back(shown->calibrated->view.project(tip));
      }
    }
    return preview;
  });
}

Expected<TunnelOutcome> Operation::go(const robot::RobotOrder& order, const std::string& token) {
  return guarded([&] {
    const OperationTunnel& tunnel = tunnel_named(order.name);
    value_or_throw(check_plan(order));
    const PlannedOrder plan = value_or_throw(gate_.planned(order.name));
    in_place_.clear();
    notify_(Step::navigate, order.name);
    const robot::Measure measure = [&] {
      return guarded([&] {
        return value_or_throw(
            measure_tool(look(record::Look::correct), plan_, *hand_eye_, tunnel.bone, plan.bone_from_target));
      });
    };
    const auto loop = guarded([&] { return carry_out(order, token, measure, in_place(plan.watch)); });
    if (!loop && loop.error().reason == Reason::plan_stale) gate_.found_stale(order.name, loop.error());
    value_or_throw(loop);
    record(record::Navigated{order.name, *loop});
    notify_(Step::verify, order.name);
    auto outcome = guarded([&] { return check(tunnel); });
    if (!outcome) static_cast<void>(guarded([&] { record_halt(order.name, outcome.error()); }));
    value_or_throw(outcome);
    outcome->loop = *loop;
    outcome->replans = replans_[order.name];
    return *outcome;
  });
}

TunnelOutcome Operation::check(const OperationTunnel& tunnel) {
  const guidance::Poses now = value_or_throw(poses_now(look(record::Look::verify), plan_.tracker));
  const TrackedTool tracked = tool();
  const guidance::ToolLine line =
      value_or_throw(tool_line(tunnel.name, tunnel.bone, views_.front().poses, now, tracked.marker_from_tip));
  const pipeline::Result checked = run(now, {line});
  TunnelOutcome outcome = value_or_throw(outcome_of(tunnel, checked, tracked));
  record(record::Outcome{outcome.tunnel, outcome.start, outcome.end, outcome.depth()});
  if (outcome.verification) verifications_.insert_or_assign(tunnel.name, *outcome.verification);
  return outcome;
}

Expected<case_registration::Measurement> Operation::measurement() const {
  if (!result_) return fail(Reason::usage, "no measurement of the present images");
  case_registration::Measurement measured{*result_, registration_, exposures()};
  for (const auto& [tunnel, verification] : verifications_) {
    measured.result.verifications.push_back(verification);
    warn_of_depth(verification, measured.result);
  }
  return measured;
}

}  // namespace helicarm::operation
