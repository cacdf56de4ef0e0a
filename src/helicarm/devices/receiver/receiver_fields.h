// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "helicarm/core/field.h"
#include "helicarm/devices/receiver/receiver.h"

namespace helicarm {

/// What a person may set of the receiver beside its address and names.
inline constexpr std::array<Field<ReceiverOptions>, 6> receiver_fields{
    bound<&ReceiverOptions::port>({.name = "port",
                                   .flag = "--port",
                                   .range = {0, 65535},
                                   .step = 1,
                                   .help = "Port for pictures (DICOM); 0: any that is free"}),
    bound<&ReceiverOptions::most_associations>(
        {.name = "most_associations",
         .flag = "--associations",
         .range = {1, 1000},
         .step = 1,
         .help = "Associations at once; where all send images, more are rejected for now"}),
    bound<&ReceiverOptions::most_of_address>(
        {.name = "most_of_address",
         .flag = "--associations-of-address",
         .range = {1, 1000},
         .step = 1,
         .help = "Of these, from one address: C-arms behind one router count together"}),
    bound<&ReceiverOptions::echo_limit_s>(
        {.name = "echo_limit_s",
         .flag = "--echo-limit",
         .unit = "s",
         .range = {0.1, 86400},
         .help = "An association that sends no image for so long is ended, though it echoes"}),
    bound<&ReceiverOptions::idle_limit_s>({.name = "idle_limit_s",
                                           .unit = "s",
                                           .range = {0.1, 3600},
                                           .help = "A C-arm that says nothing for so long is hung up on"}),
    bound<&ReceiverOptions::object_limit_s>({.name = "object_limit_s",
                                             .unit = "s",
                                             .range = {0.1, 3600},
                                             .help = "Longest time that one picture may take to come"})};

}  // namespace helicarm
