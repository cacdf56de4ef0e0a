// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/operation/operation.h"
#include "helicarm/virtual_devices/virtual_devices.h"

namespace helicarm {

struct RehearsalOptions {
  int image_size = 1024;
  double tracker_rate_hz = 60;
  bool move_bones = true;  ///< between exposure and navigation, as legs do
  std::function<void(const std::string&)> notify = [](const std::string&) {};
};

/// A tunnel's end after the tool was brought to its tunnel.
struct EndError {
  std::string name;     ///< FS, FE, TS, TE
  double true_mm;       ///< from the ball to the tool's axis, as only the virtual room knows
  double measured_mm;   ///< the same by tracker and X-rays
  double predicted_mm;  ///< root mean square to be expected
  bool covered;         ///< whether the 95 % ellipse about the measured place holds the true one
  std::optional<double> in_xrays_mm;  ///< Eq. 17 at the point's depth; nothing where not computed
};

struct Rehearsal {
  std::uint64_t seed;
  std::vector<EndError> ends;
  double hand_eye_rms_mm = 0;
  int corrections = 0;  ///< of the closed loops
};

/// What an operation in the virtual room needs to know; the picks are a surgeon's clicks near the balls.
OperationPlan plan_for(virtual_devices::VirtualDevices& virtual_or, std::uint16_t tracker_port);

/// One pair of bones from the first X-ray to the last check, over the real protocols through sockets:
/// C-STORE, OpenIGTLink, RTDE, dashboard and script. `folder` takes the session. Fails with the first
/// refusal.
Expected<Rehearsal> rehearse(std::uint64_t seed, const std::filesystem::path& folder,
                             const RehearsalOptions& options);

}  // namespace helicarm
