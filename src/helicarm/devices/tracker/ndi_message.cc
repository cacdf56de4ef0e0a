// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/ndi_message.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include "helicarm/core/text.h"

namespace helicarm::tracker {
namespace {

constexpr std::string_view binary_start = "\xc4\xa5";
constexpr std::size_t binary_header = 6, crc_bytes = 2, text_crc = 4;
constexpr std::size_t largest_reply = std::size_t{64} << 10;

Failure bad_crc(std::uint16_t stated, std::uint16_t found) {
  return {Reason::bad_value,
          fmt::format("CRC {:04X} of a reply whose bytes have {:04X}", stated, found),
          {},
          {{"crc", double(stated)}}};
}

std::uint32_t little_endian(std::string_view bytes) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) value |= std::uint32_t(std::uint8_t(bytes[i])) << 8 * i;
  return value;
}

void append(std::string& bytes, std::uint32_t value, int count) {
  for (int i = 0; i < count; ++i) bytes += char(value >> 8 * i & 0xFF);
}

/// What the device says of its own errors.
std::string_view error_words(std::uint32_t error) {
  switch (error) {
    case 0x01:
      return "invalid command";
    case 0x04:
      return "wrong CRC of the command";
    case 0x05:
      return "the command took too long";
    case 0x08:
      return "invalid port handle";
    case 0x0C:
      return "the command is invalid in the current mode";
    case 0x0D:
      return "no tool in the port";
    case 0x0E:
      return "the port is not initialised";
    case 0x10:
      return "the system is not initialised";
    case 0x12:
      return "tracking cannot be started";
    case 0x13:
      return "the tool cannot be initialised";
    case 0x15:
      return "the system cannot be initialised";
    case 0x22:
      return "the tools' wavelength is not measured in this volume";
    case 0x28:
      return "too many tools, or a type of tool that is not supported";
    case 0x2D:
      return "all port handles are taken";
    case 0x33:
      return "not available in this device";
    case 0x39:
      return "permission denied";
    case 0x40:
      return "the tool definition is invalid";
    case 0x41:
      return "the tool's characteristics are not supported";
    default:
      return "see the device's API guide";
  }
}

/// Takes fields from the front of a reply.
class Fields {
 public:
  explicit Fields(std::string_view bytes) : left_(bytes) {}

  std::string_view take(std::size_t count) {
    if (left_.size() < count) throw BadInput(Reason::truncated, "a reply of the tracker ends early");
    const std::string_view taken = left_.substr(0, count);
    left_.remove_prefix(count);
    return taken;
  }
  bool take_if(std::string_view word) {
    if (!left_.starts_with(word)) return false;
    left_.remove_prefix(word.size());
    return true;
  }
  /// A sign and digits, in units of the last.
  double number(std::size_t count, double unit) {
    const std::string_view text = take(count);
    int digits = 0;
    const auto [end, error] = std::from_chars(text.data() + 1, text.data() + text.size(), digits);
    if ((text[0] != '+' && text[0] != '-') || error != std::errc() || end != text.data() + text.size() ||
        digits < 0)
      refuse(text);
    return (text[0] == '-' ? -digits : digits) * unit;
  }
  std::uint32_t hex(std::size_t count) {
    const std::string_view text = take(count);
    const auto value = from_hexadecimal(text);
    if (!value) refuse(text);
    return *value;
  }
  std::uint32_t integer(std::size_t count) { return little_endian(take(count)); }
  double real() { return double(std::bit_cast<float>(integer(4))); }
  bool starts_with_hex() const { return left_.size() >= 8 && from_hexadecimal(left_.substr(0, 8)); }
  bool empty() const { return left_.empty(); }

 private:
  [[noreturn]] static void refuse(std::string_view text) {
    throw BadInput(Reason::bad_value, fmt::format("\"{}\" in a reply of the tracker is no number",
                                                  without_control_characters(std::string(text))));
  }
  std::string_view left_;
};

NdiTracking binary_tracking(std::string_view data) {
  Fields fields(data);
  NdiTracking tracking;
  const std::uint32_t count = fields.integer(1);
  for (std::uint32_t i = 0; i < count; ++i) {
    NdiTool& tool = tracking.tools.emplace_back();
    tool.handle = static_cast<int>(fields.integer(1));
    const std::uint32_t state = fields.integer(1);
    if (state == 4) {
      tool.state = NdiToolState::disabled;
      continue;
    }
    if (state != 1 && state != 2)
      throw BadInput(Reason::bad_value, fmt::format("unknown state {} of a tool", state));
    if (state == 1) {
      tool.state = NdiToolState::valid;
      tool.quaternion[3] = fields.real();
      for (int axis = 0; axis < 3; ++axis) tool.quaternion[axis] = fields.real();
      for (int axis = 0; axis < 3; ++axis) tool.position[axis] = fields.real();
      tool.error_mm = fields.real();
    }
    tool.port_status = fields.integer(4);
    tool.frame = fields.integer(4);
  }
  tracking.system_status = static_cast<std::uint16_t>(fields.integer(2));
  if (!fields.empty()) throw BadInput(Reason::bad_value, "a reply of the tracker is longer than its tools");
  return tracking;
}

NdiTracking text_tracking(std::string_view text) {
  Fields fields(text);
  NdiTracking tracking;
  const std::uint32_t count = fields.hex(2);
  for (std::uint32_t i = 0; i < count; ++i) {
    NdiTool& tool = tracking.tools.emplace_back();
    tool.handle = static_cast<int>(fields.hex(2));
    if (fields.take_if("DISABLED") || fields.take_if("UNOCCUPIED")) {
      tool.state = NdiToolState::disabled;
      if (fields.starts_with_hex()) fields.take(16);
    } else {
      if (!fields.take_if("MISSING")) {
        tool.state = NdiToolState::valid;
        tool.quaternion[3] = fields.number(6, 1e-4);
        for (int axis = 0; axis < 3; ++axis) tool.quaternion[axis] = fields.number(6, 1e-4);
        for (int axis = 0; axis < 3; ++axis) tool.position[axis] = fields.number(7, 1e-2);
        tool.error_mm = fields.number(6, 1e-4);
      }
      tool.port_status = fields.hex(8);
      tool.frame = fields.hex(8);
    }
    if (!fields.take_if("\n"))
      throw BadInput(Reason::bad_value, "a tool in a reply of the tracker has no end of line");
  }
  tracking.system_status = static_cast<std::uint16_t>(fields.hex(4));
  if (!fields.empty()) throw BadInput(Reason::bad_value, "a reply of the tracker is longer than its tools");
  return tracking;
}

/// The data of a whole binary reply.
std::string_view binary_data(std::string_view reply) {
  const auto crc_at = [&](std::size_t place) {
    return std::uint16_t(little_endian(reply.substr(place, crc_bytes)));
  };
  if (reply.size() < binary_header + crc_bytes)
    throw BadInput(Reason::truncated, "a reply of the tracker ends early");
  const std::size_t head = binary_header - crc_bytes;
  if (const auto found = ndi_crc(reply.substr(0, head)); found != crc_at(head))
    throw BadInput(bad_crc(crc_at(head), found));
  const std::size_t end = reply.size() - crc_bytes;
  const std::string_view data = reply.substr(binary_header, end - binary_header);
  if (const auto found = ndi_crc(data); found != crc_at(end)) throw BadInput(bad_crc(crc_at(end), found));
  return data;
}

std::string number_text(double value, double unit, int digits) {
  const auto count =
      std::min<long long>(std::llround(std::abs(value) / unit), std::llround(std::pow(10, digits)) - 1);
  return fmt::format("{}{:0{}}", value < 0 ? '-' : '+', count, digits);
}

}  // namespace

std::uint16_t ndi_crc(std::string_view bytes) {
  std::uint16_t crc = 0;
  for (const char byte : bytes) {
    crc ^= std::uint8_t(byte);
    for (int bit = 0; bit < 8; ++bit) crc = std::uint16_t(crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1);
  }
  return crc;
}

std::string hexadecimal(std::uint32_t value, int digits) { return fmt::format("{:0{}X}", value, digits); }

std::optional<std::uint32_t> from_hexadecimal(std::string_view digits) {
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
  if (digits.empty() || digits.size() > 8 || error != std::errc() || end != digits.data() + digits.size())
    return std::nullopt;
  return value;
}

std::string ndi_command(std::string_view name, std::string_view parameters) {
  const std::string text = fmt::format("{}:{}", name, parameters);
  return fmt::format("{}{:04X}\r", text, ndi_crc(text));
}

std::string ndi_text_reply(std::string_view text) { return fmt::format("{}{:04X}\r", text, ndi_crc(text)); }

Expected<std::optional<std::size_t>> ndi_reply_size(std::string_view bytes) {
  if (bytes.starts_with(binary_start)) {
    if (bytes.size() < binary_header) return std::nullopt;
    const std::size_t size = binary_header + little_endian(bytes.substr(2, 2)) + crc_bytes;
    return bytes.size() < size ? std::nullopt : std::optional(size);
  }
  const auto end = bytes.find('\r');
  if (end != bytes.npos) return end + 1;
  if (bytes.size() > largest_reply)
    return fail(Reason::bad_size, fmt::format("a reply of the tracker is over {} bytes", largest_reply));
  return std::nullopt;
}

Expected<std::string> ndi_text(std::string_view reply) {
  if (reply.size() < text_crc + 1 || reply.back() != '\r')
    return fail(Reason::truncated, "a reply of the tracker ends early");
  const std::string_view text = reply.substr(0, reply.size() - text_crc - 1);
  const auto stated = from_hexadecimal(reply.substr(text.size(), text_crc));
  if (!stated) return fail(Reason::bad_value, "a reply of the tracker has no CRC");
  if (*stated != ndi_crc(text)) return tl::unexpected(bad_crc(std::uint16_t(*stated), ndi_crc(text)));
  if (text.starts_with("ERROR")) {
    const auto error = from_hexadecimal(text.substr(5)).value_or(0);
    return fail(Reason::unsupported,
                fmt::format("the tracker answers error {:02X}: {}", error, error_words(error)),
                {{"code", double(error)}});
  }
  return std::string(text);
}

Expected<NdiTracking> ndi_tracking(std::string_view reply) {
  if (reply.starts_with(binary_start)) return guarded([&] { return binary_tracking(binary_data(reply)); });
  const auto text = ndi_text(reply);
  if (!text) return tl::unexpected(text.error());
  return guarded([&] { return text_tracking(*text); });
}

std::string ndi_binary_reply(const NdiTracking& tracking) {
  std::string data;
  append(data, std::uint32_t(tracking.tools.size()), 1);
  for (const NdiTool& tool : tracking.tools) {
    append(data, std::uint32_t(tool.handle), 1);
    append(data, tool.state == NdiToolState::valid ? 1 : tool.state == NdiToolState::missing ? 2 : 4, 1);
    if (tool.state == NdiToolState::disabled) continue;
    if (tool.state == NdiToolState::valid)
      for (const double value :
           {tool.quaternion[3], tool.quaternion[0], tool.quaternion[1], tool.quaternion[2], tool.position[0],
            tool.position[1], tool.position[2], tool.error_mm})
        append(data, std::bit_cast<std::uint32_t>(float(value)), 4);
    append(data, tool.port_status, 4);
    append(data, tool.frame, 4);
  }
  append(data, tracking.system_status, 2);
  std::string reply(binary_start);
  append(reply, std::uint32_t(data.size()), 2);
  append(reply, ndi_crc(reply), 2);
  const std::uint16_t crc = ndi_crc(data);
  reply += data;
  append(reply, crc, 2);
  return reply;
}

std::string ndi_text_reply(const NdiTracking& tracking) {
  std::string text = hexadecimal(std::uint32_t(tracking.tools.size()), 2);
  for (const NdiTool& tool : tracking.tools) {
    text += hexadecimal(std::uint32_t(tool.handle), 2);
    if (tool.state == NdiToolState::disabled) {
      text += "DISABLED\n";
      continue;
    }
    if (tool.state == NdiToolState::missing)
      text += "MISSING";
    else {
      for (const double q : {tool.quaternion[3], tool.quaternion[0], tool.quaternion[1], tool.quaternion[2]})
        text += number_text(q, 1e-4, 5);
      for (const double t : {tool.position[0], tool.position[1], tool.position[2]})
        text += number_text(t, 1e-2, 6);
      text += number_text(tool.error_mm, 1e-4, 5);
    }
    text += hexadecimal(tool.port_status, 8) + hexadecimal(tool.frame, 8) + "\n";
  }
  return ndi_text_reply(std::string_view(text + hexadecimal(tracking.system_status, 4)));
}

std::string ndi_trouble(std::uint16_t system_status) {
  constexpr std::array words{"communication out of step", "too much infrared light", "CRC error",
                             "recoverable error",         "hardware failure",        "hardware changed"};
  constexpr std::uint16_t temperature = 1 << 9;
  std::string said;
  const auto say = [&](std::string_view word) {
    said += fmt::format("{}{}", said.empty() ? "" : ", ", word);
  };
  for (std::size_t bit = 0; bit < words.size(); ++bit)
    if (system_status >> bit & 1) say(words[bit]);
  if (system_status & temperature) say("temperature out of range");
  return said;
}

}  // namespace helicarm::tracker
