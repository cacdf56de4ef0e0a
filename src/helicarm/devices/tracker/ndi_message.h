// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"

namespace helicarm::tracker {

// Commands and replies of NDI's Combined API (Polaris, Vicra, Spectra, Vega), over TCP as over a serial line.
// A command is text. A reply is text with a CRC of four hexadecimal digits and a carriage return, or, to BX,
// a header of six bytes, data and a CRC, little endian. Lengths in mm.

/// CRC-16 of every command and reply: x^16 + x^15 + x^2 + 1, least significant bit first, from 0.
std::uint16_t ndi_crc(std::string_view bytes);

/// A command with its CRC, e.g. "INIT:E3A5\r".
std::string ndi_command(std::string_view name, std::string_view parameters = {});
/// A reply in text with its CRC, e.g. "OKAYA896\r".
std::string ndi_text_reply(std::string_view text);

/// Bytes of the first whole reply in `bytes`, text or binary; none if more have to come. `bad_size` beyond 64
/// KiB.
Expected<std::optional<std::size_t>> ndi_reply_size(std::string_view bytes);

/// Text of a whole reply without its CRC. `bad_value` with the figure "crc" for a wrong CRC; `unsupported`
/// with the figure "code" for an ERROR of the device, in words.
Expected<std::string> ndi_text(std::string_view reply);

enum class NdiToolState { valid, missing, disabled };

/// One tool in a reply of BX or TX.
struct NdiTool {
  int handle = 0;  ///< of its port, 0 to 255
  NdiToolState state = NdiToolState::missing;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector4d quaternion{0, 0, 0, 1};  ///< x y z w, as sent
  double error_mm = 0;                     ///< rms of the fit to the markers
  std::uint32_t port_status = 0;
  std::uint32_t frame = 0;  ///< count of the device's measurements
};

struct NdiTracking {
  std::vector<NdiTool> tools;
  std::uint16_t system_status = 0;
};

/// Of a port status: the tool is, or a part of its markers is, outside of the volume in which the device
/// measures truly.
inline constexpr std::uint32_t ndi_out_of_volume = 0xC0;

/// Whole replies to BX 0001 and TX 0001. `bad_value` with the figure "crc" for a wrong CRC, `truncated` or
/// `bad_value` for what is no such reply; as `ndi_text` for an ERROR.
Expected<NdiTracking> ndi_tracking(std::string_view reply);
std::string ndi_binary_reply(const NdiTracking& tracking);
std::string ndi_text_reply(const NdiTracking& tracking);

/// What a system status says, "" if nothing is wrong.
std::string ndi_trouble(std::uint16_t system_status);

/// Bytes of a tool definition in one PVWR command, and of the largest file.
inline constexpr std::size_t ndi_definition_block = 64, ndi_largest_definition = 1024;

std::string hexadecimal(std::uint32_t value, int digits);
/// None unless all characters are hexadecimal digits, 1 to 8.
std::optional<std::uint32_t> from_hexadecimal(std::string_view digits);

}  // namespace helicarm::tracker
