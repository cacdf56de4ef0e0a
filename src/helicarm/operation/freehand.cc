// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/freehand.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "helicarm/core/reason_code.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/operation/guidance_description.h"

namespace helicarm::operation {
namespace {

using Eigen::Vector3d;
using Samples = std::vector<tracker::PoseSample>;

constexpr std::string_view on_target = "on_target";

/// Scatter is estimated from this time: 15 samples at 30 Hz.
constexpr double recent_poses_s = 0.5;
/// The tip is averaged over this time: the rotational noise of a small marker acts on it by the drill's
/// length, 0.5 mm and more in one sample. A drill advanced by 2 mm/s is then 0.25 mm deeper than shown.
constexpr double mean_s = 0.25;
constexpr std::size_t median_samples = 5;  // as PlanWatch takes for a bone
/// Fewer give neither a mean (as `exposure_pose`) nor a scatter.
constexpr std::ptrdiff_t least_averaged = 3, least_recent = 5;

const Samples& samples_of(const PoseWindow& window, const std::string& marker) {
  static const Samples none;
  const auto found = window.samples.find(marker);
  return found == window.samples.end() ? none : found->second;
}

std::ptrdiff_t count_of_last(const Samples& samples, double span_s) {
  return std::ranges::count_if(samples, [&](const tracker::PoseSample& sample) {
    return sample.time_s >= samples.back().time_s - span_s;
  });
}

/// Both with at least one.
std::optional<Failure> why_too_few(const Samples& tool, const Samples& bone) {
  const auto averaged = count_of_last(tool, mean_s);
  const auto of_tool = std::ssize(tool), of_bone = std::ssize(bone);
  if (averaged >= least_averaged && of_tool >= least_recent && of_bone >= least_recent) return std::nullopt;
  return Failure{
      Reason::uncertain,
      fmt::format(
          "too few poses: of the tool {} in {:g} s and {} in {:g} s, of the bone {}, must be at least "
          "{}, {} and {}",
          averaged, mean_s, of_tool, recent_poses_s, of_bone, least_averaged, least_recent, least_recent),
      {},
      {{"averaged", averaged}, {"of_tool", of_tool}, {"of_bone", of_bone}}};
}

/// Pose of the tip in the bone, of each sample of the tool with the bone's sample nearest in time.
std::vector<geometry::RigidTransform> tips_in_bone(const Samples& tool, const Samples& bone,
                                                   const geometry::RigidTransform& marker_from_tip) {
  std::vector<geometry::RigidTransform> tips;
  for (const tracker::PoseSample& sample : tool) {
    const auto& nearest = *std::ranges::min_element(
        bone, {}, [&](const tracker::PoseSample& b) { return std::abs(b.time_s - sample.time_s); });
    tips.push_back(nearest.tracker_from_tool.inverse() * sample.tracker_from_tool * marker_from_tip);
  }
  return tips;
}

/// Root of the summed variance of single samples, by second differences: the drill's own motion at constant
/// speed cancels.
template <class Value>
double scatter(const std::vector<geometry::RigidTransform>& tips, const Value& value) {
  double squares = 0;
  for (std::size_t i = 2; i < tips.size(); ++i)
    squares += (value(tips[i]) - 2 * value(tips[i - 1]) + value(tips[i - 2])).squaredNorm() / 6;
  return tips.size() > 2 ? std::sqrt(squares / double(tips.size() - 2)) : 0;
}

/// Mean of the last poses, with the rotation about the drill of the newest.
geometry::RigidTransform mean_tip(std::span<const geometry::RigidTransform> tips) {
  Vector3d position = Vector3d::Zero(), direction = Vector3d::Zero();
  for (const geometry::RigidTransform& tip : tips) {
    position += tip.translation / static_cast<double>(tips.size());
    direction += tip.rotation.col(2);
  }
  const Eigen::Matrix3d& newest = tips.back().rotation;
  return {geometry::rotation_between(newest.col(2), direction) * newest, position};
}

/// Two standard deviations of each cause.
std::string causes_of(const AimErrors& errors, const OperationTunnel& tunnel) {
  const auto part = [](std::string_view cause, const AimError& error) {
    return fmt::format("{} {:.2g} mm and {:.2g} degrees", cause, 2 * error.distance_mm, 2 * error.angle_deg);
  };
  return fmt::format("; by {}, {}, {}, {}",
                     part(tunnel.of_model ? "the registration" : "the X-ray images", errors.images),
                     part("the tracker", errors.tracker), part("the drill's calibration", errors.tool),
                     part("the scatter of its poses", errors.scatter));
}

/// Of the mean of `averaged` poses.
void add_scatter(TunnelAim& aim, const std::vector<geometry::RigidTransform>& tips, std::size_t averaged) {
  // Of the three axes of a position two lie across the tunnel; a direction scatters across itself only.
  const double share = 1 / std::sqrt(static_cast<double>(averaged));
  const double per_axis = share *
                          scatter(tips, [](const geometry::RigidTransform& tip) { return tip.translation; }) /
                          std::sqrt(3);
  const double turn = share * scatter(tips, [](const geometry::RigidTransform& tip) -> Vector3d {
                        return tip.rotation.col(2);
                      });
  aim.errors->scatter = {std::sqrt(2) * per_axis, turn * 180 / std::numbers::pi};
  aim.distance_sigma_mm = std::hypot(aim.distance_sigma_mm, std::sqrt(2) * per_axis);
  aim.depth_sigma_mm = std::hypot(aim.depth_sigma_mm, per_axis);
  aim.angle_sigma_deg = std::hypot(aim.angle_sigma_deg, turn * 180 / std::numbers::pi);
}

}  // namespace

std::string_view Guidance::decision() const { return why_not ? code(why_not->reason) : on_target; }

Json to_json(const Guidance& guidance) {
  ToJson codec(ToJson::Unset::null);
  describe_guidance(codec, guidance);
  return std::move(codec.json);
}

void read_decision(JsonReader& reader, std::optional<Failure>& why_not) {
  const std::string decision = reader.text("decision");
  const auto message = reader.optional_text("message", 10000);
  why_not.reset();
  if (decision == on_target) return;
  const auto reason = reason_of(decision);
  if (!reason) reader.refuse(Reason::bad_value, "decision", fmt::format("\"{}\" is none", decision));
  why_not = Failure{*reason, message.value_or("")};
}

TunnelAim mean_aim(const LiveTool& live, const std::string& tunnel, const Samples& tool,
                   const Samples& bone) {
  if (tool.empty() || bone.empty())
    throw BadInput(Reason::no_pose, fmt::format("no recent pose of the {}", tool.empty() ? "tool" : "bone"));
  const auto tips = tips_in_bone(tool, bone, live.marker_from_tip());
  const auto averaged = static_cast<std::size_t>(count_of_last(tool, mean_s));
  const geometry::RigidTransform& tracker_from_bone = bone.back().tracker_from_tool;
  const geometry::RigidTransform tracker_from_marker =
      tracker_from_bone * mean_tip(std::span(tips).last(averaged)) * live.marker_from_tip().inverse();
  TunnelAim aim = value_or_throw(live.aim(tracker_from_bone, tracker_from_marker, tunnel));
  add_scatter(aim, tips, averaged);
  return aim;
}

Expected<TunnelAim> mean_aim(const LiveTool& live, const TrackerPlan& tracker, const OperationTunnel& tunnel,
                             const tracker::PoseBoard& board, double now_s) {
  return guarded([&] {
    const auto recent = [&](const std::string& marker) {
      value_or_throw(board.latest(marker, now_s));
      return board.between(marker, now_s - recent_poses_s, now_s);
    };
    const Samples tool = recent(tracker.tool), bone = recent(tracker.marker_of(tunnel.bone));
    TunnelAim aim = mean_aim(live, tunnel.name, tool, bone);
    if (const auto few = why_too_few(tool, bone)) throw BadInput(*few);
    return aim;
  });
}

Expected<FreehandGuide> FreehandGuide::begin(const OperationPlan& plan, LiveTool live,
                                             const std::string& name, const guidance::Poses& basis,
                                             double oldest_s) {
  return guarded([&] {
    const auto tunnel = std::ranges::find(plan.tunnels, name, &OperationTunnel::name);
    if (tunnel == plan.tunnels.end())
      throw BadInput(Reason::bad_value, fmt::format("{}: is not a tunnel of the plan", name));
    if (!plan.drill)
      throw BadInput(Reason::usage, "the plan has no \"drill\"; a robot carries out its tunnels");
    const auto& bone = basis.tracker_from(tunnel->bone);
    if (!bone || !basis.tracker_from_tool)
      throw BadInput(Reason::no_pose, "the marker of the drill or the bone is not visible");
    value_or_throw(live.aim(*bone, *basis.tracker_from_tool, name));
    return FreehandGuide(plan, std::move(live), *tunnel, *bone, oldest_s);
  });
}

PoseWindow FreehandGuide::recent(const tracker::PoseBoard& board, double now_s) const {
  PoseWindow window{now_s - recent_poses_s / 2, recent_poses_s / 2, {}};
  for (const std::string& marker : {tool_, bone_})
    window.samples[marker] = board.between(marker, now_s - recent_poses_s, now_s);
  return window;
}

Guidance FreehandGuide::at(const PoseWindow& recent, const GuidanceForm& form) const {
  Guidance guidance;
  const Samples &tool = samples_of(recent, tool_), &bone = samples_of(recent, bone_);
  for (const auto& [marker, samples] : {std::pair(tool_, &tool), {bone_, &bone}})
    if (samples->empty()) {
      guidance.why_not = Failure{Reason::no_pose, fmt::format("{}: its marker is not visible", marker)};
      return guidance;
    }
  guidance.age_s = recent.middle_s + recent.half_s - std::min(tool.back().time_s, bone.back().time_s);
  const auto ends = *live_.ends_in_bone(tunnel_.name);
  guidance.bone_moved =
      motion_since(tracker_from_bone_, std::span(bone).last(std::min(median_samples, bone.size())), ends);
  guidance.aim = mean_aim(live_, tunnel_.name, tool, bone);
  if (!form.states_causes) guidance.aim->errors.reset();
  guidance.why_not = why_not(guidance, form.counts_poses ? why_too_few(tool, bone) : std::nullopt);
  return guidance;
}

std::optional<Failure> FreehandGuide::why_not(const Guidance& guidance,
                                              const std::optional<Failure>& few) const {
  if (!(*guidance.age_s <= oldest_s_))
    return Failure{Reason::stale_pose, fmt::format("the newest poses are {:.3g} s old, limit {:g} s",
                                                   *guidance.age_s, oldest_s_)};
  if (const auto in_place = check_motion(bone_, *guidance.bone_moved, limits_, "guidance began",
                                         "touch its check points, if any, and begin again");
      !in_place)
    return in_place.error();
  if (few) return few;
  const TunnelAim& aim = *guidance.aim;
  // What is not a number is not within a tolerance.
  if (!(2 * aim.distance_sigma_mm <= drill_.tolerance_mm && 2 * aim.angle_sigma_deg <= drill_.tolerance_deg))
    return Failure{Reason::uncertain,
                   fmt::format("two standard deviations are {:.2g} mm and {:.2g} degrees, tolerances {:g} mm "
                               "and {:g} degrees{}",
                               2 * aim.distance_sigma_mm, 2 * aim.angle_sigma_deg, drill_.tolerance_mm,
                               drill_.tolerance_deg, aim.errors ? causes_of(*aim.errors, tunnel_) : "")};
  if (!(aim.depth_mm <= aim.length_mm + drill_.tolerance_mm))
    return Failure{Reason::off_target,
                   fmt::format("the tip is {:.1f} mm beyond the tunnel's end", aim.depth_mm - aim.length_mm)};
  if (!(aim.distance_mm <= drill_.tolerance_mm && aim.angle_deg <= drill_.tolerance_deg))
    return Failure{
        Reason::off_target,
        fmt::format("{:.1f} mm and {:.1f} degrees off the axis, tolerances {:g} mm and {:g} degrees",
                    aim.distance_mm, aim.angle_deg, drill_.tolerance_mm, drill_.tolerance_deg)};
  return std::nullopt;
}

}  // namespace helicarm::operation
