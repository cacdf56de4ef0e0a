// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "helicarm/virtual_devices/simulated_scene.h"

namespace helicarm::virtual_devices {

/// Destination of a C-arm's images.
struct ImageReceiver {
  std::string address = "127.0.0.1";
  std::uint16_t port = 11112;
  std::string title = "HELICARM";
};

enum class CArmFault {
  none,
  wrong_title,    ///< calls another application entity
  breaks_off,     ///< disconnects before the image
  same_image,     ///< sends the other view's image
  other_patient,  ///< the image belongs to another study
  held_back,      ///< sent some seconds late, while the leg moves
  no_tags,        ///< the file has neither acquisition time nor angles
};
/// Fault by name; nothing if there is none.
std::optional<CArmFault> c_arm_fault(const std::string& name);
/// All names but "none", for messages.
std::string c_arm_fault_names();

/// Sends the scene's image of a view ("AP", "LAT") by C-STORE as a new acquisition, dated by the C-arm's
/// clock, which is half a minute fast. With `held_back` the leg is moved and returned after the image is
/// sent. Refuses an unknown view (bad_value) and network or receiver errors (not_connected).
Expected<void> shoot(SimulatedScene& simulated_scene, const std::string& view, const ImageReceiver& receiver,
                     CArmFault fault = CArmFault::none);

}  // namespace helicarm::virtual_devices
