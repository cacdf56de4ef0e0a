// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/virtual_devices/virtual_devices.h"

namespace helicarm::virtual_devices {

/// Small images, on ports that the system chooses.
inline VirtualDevicesOptions on_any_ports(double tracker_rate_hz) {
  VirtualDevicesOptions options;
  options.image_size = 512;
  options.tracker_rate_hz = tracker_rate_hz;
  options.tracker_port = options.rtde_port = options.dashboard_port = options.script_port = 0;
  return options;
}

}  // namespace helicarm::virtual_devices
