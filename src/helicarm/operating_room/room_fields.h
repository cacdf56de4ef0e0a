// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "helicarm/core/field.h"
#include "helicarm/operating_room/virtual_room.h"

namespace helicarm::operating_room {

/// What a person may set of the virtual operating room. `--seed` is a flag of all commands.
inline constexpr std::array<Field<VirtualRoomOptions>, 3> room_fields{
    bound<&VirtualRoomOptions::seed>(
        {.name = "seed",
         .range = {0, 4294967295.0},
         .step = 1,
         .help = "Of all that is drawn at random: the same seed, the same room"}),
    bound<&VirtualRoomOptions::picture_size>({.name = "picture_size_px",
                                              .flag = "--size",
                                              .unit = "px",
                                              .range = {512, 1024},
                                              .step = 512,
                                              .help = "Pixels a side: 512 or 1024"}),
    bound<&VirtualRoomOptions::tracker_rate_hz>({.name = "tracker_rate_hz",
                                                 .flag = "--rate",
                                                 .unit = "Hz",
                                                 .range = {1, 1000},
                                                 .help = "Of the tracker, Hz"})};

}  // namespace helicarm::operating_room
