// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "helicarm/virtual_devices/simulated_scene.h"

namespace helicarm::virtual_devices {

/// Where a C-arm sends its images.
struct ImageReceiver {
  std::string address = "127.0.0.1";
  std::uint16_t port = 11112;
  std::string title = "HELICARM";
};

enum class CArmFault {
  none,
  wrong_title,    ///< calls somebody else
  breaks_off,     ///< hangs up before the image
  same_image,     ///< sends the other view's image
  other_patient,  ///< the image belongs to another study
  held_back,      ///< waits some seconds in the C-arm, and the leg moves meanwhile
  no_tags,        ///< the file says neither when nor from where it was acquisition
};
/// By its name; nothing where there is no such fault.
std::optional<CArmFault> c_arm_fault(const std::string& name);
/// All names but "none", for a person.
std::string c_arm_fault_names();

/// Sends the theatre's image of a view ("AP", "LAT") by C-STORE as a new exposure, dated by the C-arm's
/// clock, which is half a minute fast. Held back, the leg is moved and brought back once the image is sent.
/// Refuses an unknown view (bad_value), and what the network or the receiver had against it (not_connected).
Expected<void> shoot(SimulatedScene& simulated_scene, const std::string& view, const ImageReceiver& receiver,
                     CArmFault fault = CArmFault::none);

}  // namespace helicarm::virtual_devices
