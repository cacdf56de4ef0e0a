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
#include "helicarm/devices/tracker/ndi_server.h"
#include "helicarm/simulation/navigation_truth.h"
#include "helicarm/simulation/tracker_model.h"

namespace helicarm::virtual_devices {

/// A tracked body and its true pose.
struct FollowedBody {
  std::string name;
  simulation::TrackedBody body;
  std::function<geometry::RigidTransform()> tracker_from_body;
};

struct VirtualTrackerOptions {
  tracker::IgtlServerOptions server = {.port = 18944};
  bool ndi = false;  ///< speaks NDI's API in place of OpenIGTLink, all tools on cables
  simulation::TrackerModel model = simulation::virtual_tracker();
  double rate_hz = 30;
  std::uint64_t seed = 1;
};

enum class TrackerFault {
  frozen,              ///< repeats its last poses
  identity,            ///< sends the identity for bodies that are not visible
  not_finite,          ///< sends NaN
  time_jump,           ///< its clock is off by one hour
  silent,              ///< connected, but sends nothing
  swapped,             ///< exchanges the femur's and the tibia's markers
  swapped_calibrator,  ///< exchanges the femur's marker and one of the calibrator's
};

/// A tracker with the noise of a real one, as an OpenIGTLink server that sends the bodies' poses (TDATA), or
/// as an NDI tracker; bodies that are not visible are absent, or missing.
class VirtualTracker {
 public:
  /// Refuses as IgtlServer and NdiServer.
  static Expected<std::unique_ptr<VirtualTracker>> start(const VirtualTrackerOptions& options,
                                                         std::vector<FollowedBody> bodies);

  std::uint16_t port() const { return igtl_ ? igtl_->port() : ndi_->port(); }
  bool speaks_ndi() const { return ndi_ != nullptr; }
  double rate_hz() const { return options_.rate_hz; }
  /// Names of all tracked bodies.
  std::vector<std::string> bodies() const;
  /// Covers a body's markers; returns whether the body exists. As with `set`, every pose sent after it
  /// returns obeys.
  bool hide(const std::string& body, bool hidden);
  void set(TrackerFault fault, bool on);

 private:
  VirtualTracker(const VirtualTrackerOptions& options, std::vector<FollowedBody> bodies,
                 std::unique_ptr<tracker::IgtlServer> igtl, std::unique_ptr<tracker::NdiServer> ndi);
  void run(const std::stop_token& stop);
  struct Disturbance {
    std::set<std::string> hidden;
    std::set<TrackerFault> faults;
    bool operator==(const Disturbance&) const = default;
  };
  void notify(std::uint64_t number);
  tracker::IgtlTracking track(std::uint64_t number, const Disturbance& disturbance) const;

  VirtualTrackerOptions options_;
  std::vector<FollowedBody> bodies_;
  std::unique_ptr<tracker::IgtlServer> igtl_;  ///< or
  std::unique_ptr<tracker::NdiServer> ndi_;
  std::mutex mutex_;
  Disturbance disturbance_;
  tracker::IgtlMessage last_;
  std::jthread thread_;
};

}  // namespace helicarm::virtual_devices
