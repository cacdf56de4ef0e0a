// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/operating_room/theatre.h"

namespace helicarm::operating_room {

/// Where a C-arm sends its pictures.
struct PictureReceiver {
  std::string address = "127.0.0.1";
  std::uint16_t port = 11112;
  std::string title = "HELICARM";
};

enum class CArmFault {
  none,
  wrong_title,    ///< calls somebody else
  breaks_off,     ///< hangs up before the picture
  same_picture,   ///< sends the other view's picture
  other_patient,  ///< the picture belongs to another study
};

/// Sends the theatre's picture of a view ("AP", "LAT") by C-STORE as a new exposure. Refuses an unknown view
/// (bad_value), and what the network or the receiver had against it (not_connected).
Expected<void> shoot(const Theatre& theatre, const std::string& view, const PictureReceiver& receiver,
                     CArmFault fault = CArmFault::none);

}  // namespace helicarm::operating_room
