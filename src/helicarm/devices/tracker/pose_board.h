// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/devices/tracker/exposure_pose.h"
#include "helicarm/devices/tracker/igtl_message.h"
#include "helicarm/devices/tracker/pose_buffer.h"
#include "helicarm/devices/tracker/pose_gate.h"

namespace helicarm::tracker {

/// Seconds of this machine's monotonic clock, independent of wall clock changes.
double monotonic_seconds();

struct PoseBoardOptions {
  PoseGateOptions gate;
  double max_age_s = 0.1;       ///< of a pose that guides a robot: the time in which a drill must stop
  std::size_t capacity = 4096;  ///< poses kept per tool
  std::size_t max_tools = 64;   ///< further names are ignored; a hospital's tracker follows about ten
};

struct ToolState {
  std::string name;
  std::uint64_t accepted = 0;
  Counters rejected;                                               ///< by code of PoseFault
  std::optional<double> age_s = {};                                ///< of the newest pose
  double rate_hz = 0;                                              ///< over the last second
  std::optional<geometry::RigidTransform> tracker_from_tool = {};  ///< newest, of any age
};

/// Poses by tool: written by one thread, read by any. A tool's name is the message's device (TRANSFORM,
/// POSITION) or in the message (TDATA, QTDATA); a duplicate name within one message is rejected. A
/// TransformStatus in the metadata other than OK hides the tool.
class PoseBoard {
 public:
  explicit PoseBoard(const PoseBoardOptions& options = {}) : options_(options) {}

  void take(const IgtlMessage& message, double arrival_s);
  /// Call for a new connection: the device may have set its clock.
  void forget_time();

  /// Fails with `no_pose`, or `stale_pose` for one older than `max_age_s` (default: the board's limit).
  Expected<PoseSample> latest(const std::string& tool, double now_s,
                              std::optional<double> max_age_s = {}) const;
  /// Position of the tool since a jump whose poses are not accepted yet: three are consistent, and the newest
  /// is at most `max_age_s` old (default: the board's limit). A reason to stop, never to move.
  std::optional<PoseSample> elsewhere(const std::string& tool, double now_s,
                                      std::optional<double> max_age_s = {}) const;
  /// See `exposure_pose`.
  Expected<ExposurePose> at(const std::string& tool, double time_s,
                            const ExposurePoseOptions& options = {}) const;
  std::vector<PoseSample> between(const std::string& tool, double from_s, double to_s) const;

  std::vector<ToolState> tools(double now_s) const;
  /// The device's latest status.
  std::optional<IgtlStatus> status() const;
  std::uint64_t names_refused() const;

 private:
  struct Tool {
    PoseGate gate;
    PoseBuffer buffer;
    std::uint64_t accepted = 0;
  };
  Tool* tool(const std::string& name);
  void take_pose(const std::string& name, RawPose raw, const IgtlMessage& message);
  void take_position(const IgtlPosition& position, const IgtlMessage& message, double arrival_s);
  template <class Tools, class MatrixOf>
  void take_all(const Tools& tools, const IgtlMessage& message, double arrival_s, MatrixOf matrix_of);
  Expected<const Tool*> known(const std::string& name) const;

  PoseBoardOptions options_;
  mutable std::mutex mutex_;
  std::map<std::string, Tool> tools_;
  std::optional<IgtlStatus> status_;
  std::uint64_t names_refused_ = 0;
};

}  // namespace helicarm::tracker
