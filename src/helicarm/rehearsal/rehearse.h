// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/operation/operation.h"
#include "helicarm/virtual_devices/virtual_devices.h"

namespace helicarm::rehearsal {

struct RehearsalOptions {
  int image_size = 1024;
  double tracker_rate_hz = 60;
  bool move_bones = true;   ///< between acquisition and navigation
  bool plans_again = true;  ///< after late poses, states or heartbeats; else these end it
  std::function<void(const std::string&)> notify = [](const std::string&) {};
  bool ct_plan = false;  ///< the tunnels are lines in a CT of the knee, which is registered (`with_ct_plan`)
};

/// A tunnel's end after the tool was moved to its tunnel.
struct EndError {
  std::string name;                   ///< FS, FE, TS, TE
  double true_mm;                     ///< from the ball to the tool's axis, by the simulation's ground truth
  double measured_mm;                 ///< the same, from tracker and X-ray images
  double predicted_mm;                ///< predicted root mean square
  bool covered;                       ///< the 95 % ellipse of the measured position contains the true one
  std::optional<double> in_xrays_mm;  ///< Eq. 17 at the point's depth; empty if not computed
  double off_mm = 0;                  ///< of the measured position from the true one, across the tool's axis
};

struct Rehearsal {
  std::uint64_t seed;
  std::vector<EndError> ends;
  double hand_eye_rms_mm = 0;
  int corrections = 0;  ///< of the closed loops
  int attempts = 1;     ///< 1 + operations that a busy machine aborted before
  int replans = 0;      ///< orders planned and confirmed again after a late pose, state or heartbeat
};

/// A virtual person turns and shifts the drill by half of what is shown, and advances it while it is on
/// target and before the tunnel's end. The hand moves for `seconds`.
void follow_guidance(const operation::Guidance& shown, virtual_devices::HeldDrill& drill, double seconds);
/// The same person brings the drill before the tunnel of a bone, 4 mm and 5 degrees off its axis, and waits
/// until the tracker has seen it at rest.
void raise_drill(const guidance::Bone& bone, virtual_devices::HeldDrill& drill);

/// The plan for an operation with the virtual devices; the picks lie near the balls, as a surgeon's clicks
/// would.
operation::OperationPlan plan_for(virtual_devices::VirtualDevices& virtual_or, std::uint16_t tracker_port);

/// The same without a robot: a virtual person turns and shifts the drill as the guidance shows, and advances
/// it while it is on target. `hand_eye_rms_mm` and `corrections` are 0.
Expected<Rehearsal> rehearse_freehand(std::uint64_t seed, const std::filesystem::path& folder,
                                      const RehearsalOptions& options);

/// One pair of bones from the first X-ray image to verification, over the real protocols through sockets:
/// C-STORE, OpenIGTLink, RTDE, dashboard and script. `folder` holds the session. Fails with the first
/// refusal.
Expected<Rehearsal> rehearse(std::uint64_t seed, const std::filesystem::path& folder,
                             const RehearsalOptions& options);

}  // namespace helicarm::rehearsal
