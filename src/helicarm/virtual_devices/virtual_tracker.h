// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "helicarm/devices/tracker/igtl_server.h"
#include "helicarm/simulation/navigation_truth.h"
#include "helicarm/simulation/tracker_model.h"

namespace helicarm::virtual_devices {

/// Something that the tracker follows, and where it truly is.
struct FollowedBody {
  std::string name;
  simulation::TrackedBody body;
  std::function<RigidTransform()> tracker_from_body;
};

struct VirtualTrackerOptions {
  IgtlServerOptions server = {.port = 18944};
  simulation::TrackerModel model = simulation::virtual_tracker();
  double rate_hz = 30;
  std::uint64_t seed = 1;
};

enum class TrackerFault {
  frozen,              ///< repeats its last poses
  identity,            ///< sends the identity for what it does not see
  not_finite,          ///< sends NaN
  time_jump,           ///< its clock goes an hour wrong
  silent,              ///< connected, but says nothing
  swapped,             ///< takes the femur's marker for the tibia's, and the other way round
  swapped_calibrator,  ///< takes the femur's marker for one of the calibrator's, and the other way round
};

/// An OpenIGTLink server that tells the bodies' poses (TDATA) with the noise of a real tracker; what is not
/// seen is left out.
class VirtualTracker {
 public:
  /// Refuses as IgtlServer.
  static Expected<std::unique_ptr<VirtualTracker>> start(const VirtualTrackerOptions& options,
                                                         std::vector<FollowedBody> bodies);

  std::uint16_t port() const { return server_->port(); }
  /// Names of all that it follows.
  std::vector<std::string> bodies() const;
  /// Covers a body's markers; whether there is such a body.
  bool hide(const std::string& body, bool hidden);
  void set(TrackerFault fault, bool on);

 private:
  VirtualTracker(const VirtualTrackerOptions& options, std::vector<FollowedBody> bodies,
                 std::unique_ptr<IgtlServer> server);
  void run(const std::stop_token& stop);
  void notify(std::uint64_t number);

  VirtualTrackerOptions options_;
  std::vector<FollowedBody> bodies_;
  std::unique_ptr<IgtlServer> server_;
  std::mutex mutex_;
  std::set<std::string> hidden_;
  std::set<TrackerFault> faults_;
  IgtlMessage last_;
  std::jthread thread_;
};

}  // namespace helicarm::virtual_devices
