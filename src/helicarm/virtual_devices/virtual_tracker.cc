// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/virtual_tracker.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <limits>

#include "helicarm/core/real_time.h"

namespace helicarm::virtual_devices {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint32_t samples_stream = 2000;  // and following: two per body
constexpr double hour_s = 3600;

std::uint64_t stamp_now(double offset_s) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return tracker::stamp_from_seconds(std::chrono::duration<double>(now).count() + offset_s);
}

std::string other_bone(const std::string& name) {
  return name == "femur" ? "tibia" : name == "tibia" ? "femur" : name;
}

void swap_with_calibrator(std::vector<tracker::IgtlTool>& tools) {
  const auto femur = std::ranges::find(tools, "femur", &tracker::IgtlTool::name);
  const auto facet = std::ranges::find_if(
      tools, [](const tracker::IgtlTool& tool) { return tool.name.starts_with("calibrator/"); });
  if (femur != tools.end() && facet != tools.end()) std::swap(femur->name, facet->name);
}

}  // namespace

Expected<std::unique_ptr<VirtualTracker>> VirtualTracker::start(const VirtualTrackerOptions& options,
                                                                std::vector<FollowedBody> bodies) {
  return guarded([&] {
    std::unique_ptr<tracker::IgtlServer> igtl;
    std::unique_ptr<tracker::NdiServer> ndi;
    if (options.ndi) {
      std::vector<std::string> names;
      for (const FollowedBody& followed : bodies) names.push_back(followed.name);
      ndi = value_or_throw(
          tracker::NdiServer::start({options.server.address, options.server.port, std::move(names)}));
    } else {
      igtl = value_or_throw(tracker::IgtlServer::start(options.server));
    }
    return std::unique_ptr<VirtualTracker>(
        new VirtualTracker(options, std::move(bodies), std::move(igtl), std::move(ndi)));
  });
}

VirtualTracker::VirtualTracker(const VirtualTrackerOptions& options, std::vector<FollowedBody> bodies,
                               std::unique_ptr<tracker::IgtlServer> igtl,
                               std::unique_ptr<tracker::NdiServer> ndi)
    : options_(options),
      bodies_(std::move(bodies)),
      igtl_(std::move(igtl)),
      ndi_(std::move(ndi)),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

std::vector<std::string> VirtualTracker::bodies() const {
  std::vector<std::string> names;
  for (const FollowedBody& followed : bodies_) names.push_back(followed.name);
  return names;
}

bool VirtualTracker::hide(const std::string& body, bool hidden) {
  if (std::ranges::find(bodies_, body, &FollowedBody::name) == bodies_.end()) return false;
  const std::lock_guard lock(mutex_);
  if (hidden)
    disturbance_.hidden.insert(body);
  else
    disturbance_.hidden.erase(body);
  return true;
}

void VirtualTracker::set(TrackerFault fault, bool on) {
  const std::lock_guard lock(mutex_);
  if (on)
    disturbance_.faults.insert(fault);
  else
    disturbance_.faults.erase(fault);
}

void VirtualTracker::run(const std::stop_token& stop) {
  const RealTime priority;
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / options_.rate_hz));
  std::mutex mutex;
  std::condition_variable_any pause;
  std::unique_lock lock(mutex);
  auto next = Clock::now();
  for (std::uint64_t number = 0; !stop.stop_requested(); ++number) {
    notify(number);
    next = std::max(next + period, Clock::now() - period);  // missed samples are skipped
    pause.wait_until(lock, stop, next, [] { return false; });
  }
}

tracker::IgtlTracking VirtualTracker::track(std::uint64_t number, const Disturbance& disturbance) const {
  const auto has = [&](TrackerFault fault) { return disturbance.faults.contains(fault); };
  tracker::IgtlTracking tracking;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const FollowedBody& followed = bodies_[i];
    const geometry::RigidTransform truth = followed.tracker_from_body();
    const simulation::TrackerSample sample = simulation::track_sample(
        options_.model, followed.body, [&](double) { return truth; }, double(number) / options_.rate_hz,
        options_.seed, samples_stream + 2 * std::uint32_t(i), number);
    if (sample.valid() && !disturbance.hidden.contains(followed.name))
      tracking.tools.push_back({has(TrackerFault::swapped) ? other_bone(followed.name) : followed.name, 2,
                                sample.tracker_from_body->matrix()});
    else if (has(TrackerFault::identity))
      tracking.tools.push_back({followed.name, 2, Eigen::Matrix4d::Identity()});
  }
  if (has(TrackerFault::not_finite))
    for (tracker::IgtlTool& tool : tracking.tools)
      tool.matrix(0, 3) = std::numeric_limits<double>::quiet_NaN();
  if (has(TrackerFault::swapped_calibrator)) swap_with_calibrator(tracking.tools);
  return tracking;
}

void VirtualTracker::notify(std::uint64_t number) {
  std::unique_lock lock(mutex_);
  for (;;) {
    const Disturbance disturbance = disturbance_;
    const auto has = [&](TrackerFault fault) { return disturbance.faults.contains(fault); };
    if (has(TrackerFault::silent)) return;
    if (!has(TrackerFault::frozen)) {
      // Released while computing: otherwise a machine too slow for the rate would block other threads.
      lock.unlock();
      last_.content = track(number, disturbance);
      lock.lock();
      if (!(disturbance == disturbance_)) continue;
    }
    last_.device = "virtual";
    last_.stamp = stamp_now(has(TrackerFault::time_jump) ? -hour_s : 0);
    return igtl_ ? igtl_->send(last_) : ndi_->send(last_);
  }
}

}  // namespace helicarm::virtual_devices
