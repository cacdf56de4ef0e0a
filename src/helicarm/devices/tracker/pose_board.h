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

namespace helicarm {

/// Seconds of this machine's monotonic clock: no step of the wall clock makes a pose younger.
double monotonic_seconds();

struct PoseBoardOptions {
  PoseGateOptions gate;
  double max_age_s = 0.1;       ///< of a pose that guides a robot: the time in which a drill must stop
  std::size_t capacity = 4096;  ///< poses kept of each tool
  std::size_t max_tools = 64;   ///< names beyond are not believed; a hospital's tracker follows ten
};

struct ToolState {
  std::string name;
  std::uint64_t accepted = 0;
  Counters rejected;                                     ///< by code of PoseFault
  std::optional<double> age_s = {};                      ///< of the newest pose
  double rate_hz = 0;                                    ///< over the last second
  std::optional<RigidTransform> tracker_from_tool = {};  ///< newest, however old
};

/// What a tracker says, by tool: filled by one thread, read by any. A tool is named by the message's device
/// (TRANSFORM, POSITION) or by the message itself (TDATA, QTDATA); a name that one message gives twice is
/// believed for neither. A TransformStatus in the metadata other than OK hides the tool.
class PoseBoard {
 public:
  explicit PoseBoard(const PoseBoardOptions& options = {}) : options_(options) {}

  void take(const IgtlMessage& message, double arrival_s);
  /// To be called when a connection is new: the device may have set its clock.
  void forget_time();

  /// Fails with `no_pose`, or `stale_pose` for one older than `max_age_s`, the board's own limit if none is
  /// given.
  Expected<PoseSample> latest(const std::string& tool, double now_s,
                              std::optional<double> max_age_s = {}) const;
  /// Where the tool seems to be since a jump whose poses are not believed yet: three of them agree, and the
  /// newest is no older than `max_age_s`, the board's own limit if none is given. A reason to stop, never to
  /// move.
  std::optional<PoseSample> elsewhere(const std::string& tool, double now_s,
                                      std::optional<double> max_age_s = {}) const;
  /// As `exposure_pose`.
  Expected<ExposurePose> at(const std::string& tool, double time_s,
                            const ExposurePoseOptions& options = {}) const;
  std::vector<PoseSample> between(const std::string& tool, double from_s, double to_s) const;

  std::vector<ToolState> tools(double now_s) const;
  /// The device's last word about itself.
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
  template <class Tools, class MatrixOf>
  void take_all(const Tools& tools, const IgtlMessage& message, double arrival_s, MatrixOf matrix_of);
  Expected<const Tool*> known(const std::string& name) const;

  PoseBoardOptions options_;
  mutable std::mutex mutex_;
  std::map<std::string, Tool> tools_;
  std::optional<IgtlStatus> status_;
  std::uint64_t names_refused_ = 0;
};

}  // namespace helicarm
