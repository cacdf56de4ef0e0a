// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "helicarm/core/field.h"
#include "helicarm/devices/receiver/receiver.h"

namespace helicarm::receiver {

/// User options of the receiver besides its address and names.
inline constexpr std::array<Field<ReceiverOptions>, 6> receiver_fields{
    bound<&ReceiverOptions::port>({.name = "port",
                                   .flag = "--port",
                                   .range = {0, 65535},
                                   .step = 1,
                                   .help = "Port for images (DICOM); 0: any free port"}),
    bound<&ReceiverOptions::most_associations>(
        {.name = "most_associations",
         .flag = "--associations",
         .range = {1, 1000},
         .step = 1,
         .help = "Concurrent associations; if all send images, further ones are rejected"}),
    bound<&ReceiverOptions::most_of_address>(
        {.name = "most_of_address",
         .flag = "--associations-of-address",
         .range = {1, 1000},
         .step = 1,
         .help = "Concurrent associations from one address; C-arms behind one router have the same address"}),
    bound<&ReceiverOptions::echo_limit_s>(
        {.name = "echo_limit_s",
         .flag = "--echo-limit",
         .unit = "s",
         .range = {0.1, 86400},
         .help = "An association without an image is ended after this time, even if it echoes"}),
    bound<&ReceiverOptions::idle_limit_s>({.name = "idle_limit_s",
                                           .unit = "s",
                                           .range = {0.1, 3600},
                                           .help = "A silent C-arm is disconnected after this time"}),
    bound<&ReceiverOptions::object_limit_s>({.name = "object_limit_s",
                                             .unit = "s",
                                             .range = {0.1, 3600},
                                             .help = "Longest time for receiving one image"})};

}  // namespace helicarm::receiver
