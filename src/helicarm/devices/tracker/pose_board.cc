// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/pose_board.h"

#include <chrono>
#include <map>
#include <string_view>

#include <fmt/format.h>

#include "helicarm/devices/tracker/tool_status.h"

namespace helicarm::tracker {
double monotonic_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

PoseBoard::Tool* PoseBoard::tool(const std::string& name) {
  if (const auto found = tools_.find(name); found != tools_.end()) return &found->second;
  if (tools_.size() >= options_.max_tools) {
    ++names_refused_;
    return nullptr;
  }
  return &tools_.emplace(name, Tool{PoseGate(options_.gate), PoseBuffer(options_.capacity)}).first->second;
}

void PoseBoard::take_pose(const std::string& name, RawPose raw, const IgtlMessage& message) {
  Tool* const to = tool(name);
  if (!to) return;
  raw.device_s = seconds_from_stamp(message.stamp);
  raw.visible = is_visible(message, name);
  if (const auto sample = to->gate.pass(raw)) {
    to->buffer.push(*sample);
    ++to->accepted;
  }
}

template <class Tools, class MatrixOf>
void PoseBoard::take_all(const Tools& tools, const IgtlMessage& message, double arrival_s,
                         MatrixOf matrix_of) {
  std::map<std::string_view, int> times;
  for (const auto& one : tools) ++times[one.name];
  for (const auto& one : tools) {
    if (times.at(one.name) == 1)
      take_pose(one.name, {matrix_of(one), 0, arrival_s}, message);
    else if (Tool* const to = tool(one.name))
      to->gate.reject(PoseFault::name_twice);
  }
}

void PoseBoard::take_position(const IgtlPosition& position, const IgtlMessage& message, double arrival_s) {
  if (position.quaternion)
    take_pose(tool_name(message), {matrix_from(position.position, *position.quaternion), 0, arrival_s},
              message);
  else if (Tool* const to = tool(tool_name(message)))
    to->gate.reject(PoseFault::no_rotation);
}

void PoseBoard::take(const IgtlMessage& message, double arrival_s) {
  const std::lock_guard lock(mutex_);
  const IgtlContent& content = message.content;
  if (const auto* transform = std::get_if<IgtlTransform>(&content))
    take_pose(tool_name(message), {transform->matrix, 0, arrival_s}, message);
  else if (const auto* position = std::get_if<IgtlPosition>(&content))
    take_position(*position, message, arrival_s);
  else if (const auto* tracking = std::get_if<IgtlTracking>(&content))
    take_all(tracking->tools, message, arrival_s, [](const IgtlTool& one) { return one.matrix; });
  else if (const auto* quaternions = std::get_if<IgtlQuaternions>(&content))
    take_all(quaternions->tools, message, arrival_s,
             [](const IgtlQuaternionTool& one) { return matrix_from(one.position, one.quaternion); });
  else if (const auto* status = std::get_if<IgtlStatus>(&content))
    status_ = *status;
}

void PoseBoard::forget_time() {
  const std::lock_guard lock(mutex_);
  for (auto& [name, tool] : tools_) tool.gate.forget_time();
}

Expected<const PoseBoard::Tool*> PoseBoard::known(const std::string& name) const {
  const auto found = tools_.find(name);
  if (found == tools_.end() || found->second.buffer.size() == 0)
    return fail(Reason::no_pose, fmt::format("no pose of \"{}\" received", name));
  return &found->second;
}

Expected<PoseSample> PoseBoard::latest(const std::string& name, double now_s,
                                       std::optional<double> max_age_s) const {
  const std::lock_guard lock(mutex_);
  const auto tool = known(name);
  if (!tool) return tl::unexpected(tool.error());
  const PoseSample newest = *(*tool)->buffer.latest();
  const double age = now_s - newest.time_s, limit = max_age_s.value_or(options_.max_age_s);
  if (age > limit)
    return fail(Reason::stale_pose,
                fmt::format("the newest pose of \"{}\" is {:.3g} s old, limit {:g} s", name, age, limit),
                {{"age_s", age}});
  return newest;
}

std::optional<PoseSample> PoseBoard::elsewhere(const std::string& name, double now_s,
                                               std::optional<double> max_age_s) const {
  const std::lock_guard lock(mutex_);
  const auto found = tools_.find(name);
  if (found == tools_.end()) return std::nullopt;
  const auto seen = found->second.gate.elsewhere();
  return seen && now_s - seen->time_s <= max_age_s.value_or(options_.max_age_s) ? seen : std::nullopt;
}

std::vector<PoseSample> PoseBoard::between(const std::string& name, double from_s, double to_s) const {
  const std::lock_guard lock(mutex_);
  const auto tool = known(name);
  return tool ? (*tool)->buffer.between(from_s, to_s) : std::vector<PoseSample>{};
}

Expected<ExposurePose> PoseBoard::at(const std::string& name, double time_s,
                                     const ExposurePoseOptions& options) const {
  const double reach = std::max(options.window_s, options.max_gap_s);
  std::vector<PoseSample> samples = between(name, time_s - reach, time_s + reach);
  if (samples.empty()) {
    // Reports the age of the newest pose in the refusal.
    const auto newest = latest(name, time_s, 0);
    if (!newest) return tl::unexpected(newest.error());
    samples.push_back(*newest);
  }
  return exposure_pose(samples, time_s, options);
}

std::vector<ToolState> PoseBoard::tools(double now_s) const {
  const std::lock_guard lock(mutex_);
  std::vector<ToolState> states;
  for (const auto& [name, tool] : tools_) {
    ToolState state{name, tool.accepted, tool.gate.rejected()};
    if (const auto newest = tool.buffer.latest()) {
      state.age_s = now_s - newest->time_s;
      state.tracker_from_tool = newest->tracker_from_tool;
    }
    state.rate_hz = static_cast<double>(tool.buffer.between(now_s - 1, now_s).size());
    states.push_back(std::move(state));
  }
  return states;
}

std::optional<IgtlStatus> PoseBoard::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

std::uint64_t PoseBoard::names_refused() const {
  const std::lock_guard lock(mutex_);
  return names_refused_;
}

}  // namespace helicarm::tracker
