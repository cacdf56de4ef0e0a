// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "helicarm/core/failure.h"

/// DICOM messages (PS3.7): those that the receiver supports.
namespace helicarm::receiver::dicom {

enum class Operation : std::uint16_t {
  store = 0x0001,
  echo = 0x0030,
  action = 0x0130,
  cancel = 0x0FFF,
  event_report_response = 0x8100
};

struct Command {
  std::uint16_t field = 0;  ///< can be a value outside Operation
  std::uint16_t message_id = 0;
  std::string sop_class;     ///< affected or requested
  std::string sop_instance;  ///< affected or requested
  std::uint16_t action_type = 0;
  std::uint16_t status = 0;  ///< of a response
  bool data_set_follows = false;

  bool is(Operation operation) const { return field == static_cast<std::uint16_t>(operation); }
};

/// PS3.7 annex C and PS3.4, B.2.3.
enum class Status : std::uint16_t {
  success = 0x0000,
  no_such_instance = 0x0112,
  invalid_argument = 0x0115,
  no_such_class = 0x0118,
  sop_class_unknown = 0x0122,
  no_such_action = 0x0123,
  operation_unknown = 0x0211,
  resource_limitation = 0x0213,
  out_of_resources = 0xA700,
  data_set_does_not_match = 0xA900,
  cannot_understand = 0xC000
};

/// A complete command set (group 0000, implicit, little endian). Refuses truncated, bad_value.
Expected<Command> read_command(std::string_view bytes);

/// Response to a command; `comment` (at most 64 characters are sent) states why it was refused.
std::string write_response(const Command& command, Status status, std::string_view comment = {});

struct EventReport {
  std::uint16_t message_id;
  std::string sop_class, sop_instance;
  std::uint16_t event_type;
};

/// N-EVENT-REPORT; its data set follows.
std::string write_event_report(const EventReport& event);

std::string little_endian(std::uint32_t value, std::size_t size);
/// An element in the implicit syntax; text is padded by a NUL.
std::string element(std::uint32_t tag, std::string value);

}  // namespace helicarm::receiver::dicom
