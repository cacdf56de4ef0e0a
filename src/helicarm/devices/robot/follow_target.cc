// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/follow_target.h"

#include <numbers>

#include <fmt/format.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::robot {
namespace {

tl::unexpected<Failure> refusal(Reason reason, const std::string& why, const std::vector<Miss>& misses) {
  const Miss& last = misses.back();
  return fail(reason,
              fmt::format("the tool is {:.2f} mm and {:.2f} degrees off after {} corrections: {}",
                          last.distance_mm, last.turn_deg, misses.size() - 1, why),
              {{"distance_mm", last.distance_mm},
               {"turn_deg", last.turn_deg},
               {"sigma_mm", last.sigma_mm},
               {"corrections", static_cast<double>(misses.size() - 1)}});
}

}  // namespace

Expected<Miss> miss_of(const ToolMeasurement& seen) {
  const geometry::RigidTransform tcp_from_target = seen.tracker_from_tcp.inverse() * seen.tracker_from_target;
  if (!tcp_from_target.matrix().allFinite() || !seen.covariance.allFinite())
    return fail(Reason::not_finite, "the tracker's measurement of the tool is not finite");
  return Miss{tcp_from_target.translation.norm(),
              geometry::vector_from_rotation(tcp_from_target.rotation).norm() * 180 / std::numbers::pi,
              std::sqrt(std::max(0.0, seen.covariance.topLeftCorner<3, 3>().trace()))};
}

Expected<std::vector<Miss>> follow_target(const Corrections& corrections, const Measure& measure,
                                          const MoveTool& move) {
  std::vector<Miss> misses;
  for (;;) {
    const auto seen = measure();
    if (!seen) return tl::unexpected<Failure>(seen.error());
    const auto miss = miss_of(*seen);
    if (!miss) return tl::unexpected<Failure>(miss.error());
    misses.push_back(*miss);
    const Miss& now = misses.back();
    if (2 * now.sigma_mm > corrections.tolerance_mm)
      return refusal(Reason::uncertain, "the tracker's uncertainty exceeds the tolerance", misses);
    if (now.distance_mm <= corrections.tolerance_mm && now.turn_deg <= corrections.tolerance_deg)
      return misses;
    if (static_cast<int>(misses.size()) > corrections.most)
      return refusal(Reason::off_target, "iteration limit reached", misses);
    if (now.distance_mm > corrections.longest_mm || now.turn_deg > corrections.widest_deg)
      return refusal(Reason::off_target, "the next correction exceeds its limit", misses);
    if (misses.size() > 1 && now.distance_mm > misses[misses.size() - 2].distance_mm + 2 * now.sigma_mm)
      return refusal(Reason::off_target, "the last correction increased the error", misses);
    if (const auto moved = move(seen->tracker_from_tcp.inverse() * seen->tracker_from_target); !moved)
      return tl::unexpected<Failure>(moved.error());
  }
}

}  // namespace helicarm::robot
