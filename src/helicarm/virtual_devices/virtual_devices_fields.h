// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "helicarm/core/field.h"
#include "helicarm/virtual_devices/virtual_devices.h"

namespace helicarm::virtual_devices {

/// User options of the virtual devices. `--seed` is an option of all commands.
inline constexpr std::array<Field<VirtualDevicesOptions>, 3> virtual_devices_fields{
    bound<&VirtualDevicesOptions::seed>({.name = "seed",
                                         .range = {0, 4294967295.0},
                                         .step = 1,
                                         .help = "Random seed: the same seed gives the same scene"}),
    bound<&VirtualDevicesOptions::image_size>({.name = "picture_size_px",
                                               .flag = "--size",
                                               .unit = "px",
                                               .range = {512, 1024},
                                               .step = 512,
                                               .help = "Image size in pixels per side: 512 or 1024"}),
    bound<&VirtualDevicesOptions::tracker_rate_hz>({.name = "tracker_rate_hz",
                                                    .flag = "--rate",
                                                    .unit = "Hz",
                                                    .range = {1, 1000},
                                                    .help = "Tracker rate, Hz"})};

}  // namespace helicarm::virtual_devices
