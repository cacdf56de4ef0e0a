// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/dimse.h"

#include <optional>

#include <fmt/format.h>

#include "helicarm/core/text.h"
#include "helicarm/devices/receiver/pdu.h"

namespace helicarm::receiver::dicom {
namespace {

enum Element : std::uint16_t {
  group_length = 0x0000,
  affected_sop_class = 0x0002,
  requested_sop_class = 0x0003,
  command_field = 0x0100,
  message_id = 0x0110,
  responded_message_id = 0x0120,
  data_set_type = 0x0800,
  status = 0x0900,
  error_comment = 0x0902,
  affected_sop_instance = 0x1000,
  requested_sop_instance = 0x1001,
  event_type = 0x1002,
  action_type = 0x1008
};

constexpr std::uint16_t a_data_set = 0x0000, no_data_set = 0x0101;
constexpr std::uint16_t event_report = 0x0100;

std::uint32_t number_of(std::string_view bytes) {
  std::uint32_t value = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[i]);
  return value;
}

std::string with_length(const std::string& rest) {
  return element(group_length, little_endian(static_cast<std::uint32_t>(rest.size()), 4)) + rest;
}

[[noreturn]] void refuse(Element number, std::string_view problem) {
  throw BadInput(Reason::bad_value, fmt::format("command (0000,{:04X}) {}", std::uint16_t{number}, problem));
}

std::uint16_t word(Element number, std::string_view value) {
  if (value.size() != 2) refuse(number, fmt::format("has {} bytes, must have 2", value.size()));
  return static_cast<std::uint16_t>(number_of(value));
}

std::string uid(Element number, std::string_view value) {
  if (value.ends_with('\0') || value.ends_with(' ')) value.remove_suffix(1);
  if (!is_uid(value)) refuse(number, "is not a valid UID");
  return std::string(value);
}

}  // namespace

std::string little_endian(std::uint32_t value, std::size_t size) {
  std::string bytes;
  for (std::size_t i = 0; i < size; ++i) bytes += static_cast<char>(value >> (8 * i));
  return bytes;
}

std::string element(std::uint32_t tag, std::string value) {
  if (value.size() % 2 != 0) value += '\0';
  return little_endian(tag >> 16, 2) + little_endian(tag & 0xFFFF, 2) +
         little_endian(static_cast<std::uint32_t>(value.size()), 4) + value;
}

Expected<Command> read_command(std::string_view bytes) {
  return guarded([&] {
    Command command;
    std::optional<std::uint16_t> type;
    std::int64_t before = -1;
    while (!bytes.empty()) {
      if (bytes.size() < 8) throw BadInput(Reason::truncated, "command ends within an element");
      const auto number = static_cast<Element>(number_of(bytes.substr(2, 2)));
      const std::uint32_t length = number_of(bytes.substr(4, 4));
      if (number_of(bytes.substr(0, 2)) != 0 || number <= before)
        throw BadInput(Reason::bad_value, "command contains an element out of order or of another group");
      before = number;
      if (length > bytes.size() - 8) throw BadInput(Reason::truncated, "command ends within a value");
      const std::string_view value = bytes.substr(8, length);
      bytes.remove_prefix(8 + length);
      if (number == affected_sop_class || number == requested_sop_class)
        command.sop_class = uid(number, value);
      if (number == command_field) command.field = word(number, value);
      if (number == message_id) command.message_id = word(number, value);
      if (number == data_set_type) type = word(number, value);
      if (number == status) command.status = word(number, value);
      if (number == action_type) command.action_type = word(number, value);
      if (number == affected_sop_instance || number == requested_sop_instance)
        command.sop_instance = uid(number, value);
    }
    if (command.field == 0 || !type) refuse(command_field, "or the type of the data set is missing");
    command.data_set_follows = *type != no_data_set;
    return command;
  });
}

std::string write_response(const Command& command, Status answer, std::string_view comment) {
  std::string rest = element(command_field, little_endian(command.field | 0x8000u, 2)) +
                     element(responded_message_id, little_endian(command.message_id, 2)) +
                     element(data_set_type, little_endian(no_data_set, 2)) +
                     element(status, little_endian(static_cast<std::uint16_t>(answer), 2));
  if (!command.sop_class.empty()) rest = element(affected_sop_class, command.sop_class) + rest;
  if (!comment.empty()) {
    std::string text = without_control_characters(std::string(comment.substr(0, 64)));
    if (text.size() % 2 != 0) text += ' ';
    rest += element(error_comment, std::move(text));
  }
  if (!command.sop_instance.empty()) rest += element(affected_sop_instance, command.sop_instance);
  if (command.is(Operation::action)) rest += element(action_type, little_endian(command.action_type, 2));
  return with_length(rest);
}

std::string write_event_report(const EventReport& event) {
  return with_length(element(affected_sop_class, event.sop_class) +
                     element(command_field, little_endian(event_report, 2)) +
                     element(message_id, little_endian(event.message_id, 2)) +
                     element(data_set_type, little_endian(a_data_set, 2)) +
                     element(affected_sop_instance, event.sop_instance) +
                     element(event_type, little_endian(event.event_type, 2)));
}

}  // namespace helicarm::receiver::dicom
