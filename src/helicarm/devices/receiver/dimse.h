// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "helicarm/core/failure.h"

/// DICOM messages (PS3.7): the two that the receiver supports.
namespace helicarm::receiver::dicom {

enum class Operation : std::uint16_t { store = 0x0001, echo = 0x0030, cancel = 0x0FFF };

struct Command {
  std::uint16_t field = 0;  ///< can be a value outside Operation
  std::uint16_t message_id = 0;
  std::string sop_class;
  std::string sop_instance;
  bool data_set_follows = false;

  bool is(Operation operation) const { return field == static_cast<std::uint16_t>(operation); }
};

/// PS3.7 annex C and PS3.4, B.2.3.
enum class Status : std::uint16_t {
  success = 0x0000,
  sop_class_unknown = 0x0122,
  operation_unknown = 0x0211,
  out_of_resources = 0xA700,
  data_set_does_not_match = 0xA900,
  cannot_understand = 0xC000
};

/// A complete command set (group 0000, implicit, little endian). Refuses truncated, bad_value.
Expected<Command> read_command(std::string_view bytes);

/// Response to a command; `comment` (at most 64 characters are sent) states why it was refused.
std::string write_response(const Command& command, Status status, std::string_view comment = {});

}  // namespace helicarm::receiver::dicom
