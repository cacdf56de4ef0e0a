// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"

namespace helicarm::tracker {

// OpenIGTLink content, unchecked except for lengths: PoseGate decides whether a matrix is a pose. Lengths in
// mm.

struct IgtlTransform {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
};

struct IgtlTool {
  std::string name;
  std::uint8_t type = 1;  ///< 1 tracker, 2 6D, 3 3D, 4 5D
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
};
/// TDATA: the tools visible at one moment; hidden ones are absent.
struct IgtlTracking {
  std::vector<IgtlTool> tools;
};

struct IgtlQuaternionTool {
  std::string name;
  std::uint8_t type = 1;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector4d quaternion{0, 0, 0, 1};  ///< x y z w, as sent: not necessarily of unit length
};
/// QTDATA
struct IgtlQuaternions {
  std::vector<IgtlQuaternionTool> tools;
};

struct IgtlPosition {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector4d> quaternion = {};  ///< x y z w; without it the message is a point, not a pose
};

struct IgtlStatus {
  std::uint16_t code = 1;  ///< 1 is OK
  std::int64_t subcode = 0;
  std::string error_name;
  std::string text;
};

/// STT_TDATA and STT_QTDATA
struct IgtlStart {
  std::string what;  ///< requested type, e.g. TDATA
  std::int32_t interval_ms = 0;
  std::string coordinates = {};
};
/// STP_*
struct IgtlStop {
  std::string what;
};
/// GET_*
struct IgtlGet {
  std::string what;
};
/// RTS_*: answer to STT_*, STP_* or GET_*
struct IgtlReply {
  std::string what;
  std::uint8_t status = 0;  ///< 0 is OK
};

/// A type that is not supported, as received.
struct IgtlUnknown {
  std::string type;
  std::string content;
};

using IgtlContent = std::variant<IgtlTransform, IgtlTracking, IgtlQuaternions, IgtlPosition, IgtlStatus,
                                 IgtlStart, IgtlStop, IgtlGet, IgtlReply, IgtlUnknown>;

struct IgtlMessage {
  std::string device;
  std::uint64_t stamp = 0;  ///< seconds since 1970 in the upper 32 bits, fraction below; 0: none
  IgtlContent content;
  std::uint16_t version = 1;  ///< of the header; 2 has an identifier and metadata
  std::uint32_t id = 0;
  std::map<std::string, std::string> metadata = {};
};

struct IgtlHeader {
  static constexpr std::size_t size = 58;
  std::uint16_t version = 1;
  std::string type;
  std::string device;
  std::uint64_t stamp = 0;
  std::uint64_t body_size = 0;
  std::uint64_t crc = 0;
};

double seconds_from_stamp(std::uint64_t stamp);
/// Rounded to 2^-32 s; times before 1970 and NaN give 0.
std::uint64_t stamp_from_seconds(double seconds);

/// Largest accepted body: 64 MiB for IMAGE, which a server may send besides poses, 1 MiB for other types.
std::uint64_t body_limit(std::string_view type);

/// The first 58 bytes of a message. `truncated`; `bad_value` if the type is not a name or the version is 0,
/// i.e. this is not a header; `bad_size` for a body above its limit.
Expected<IgtlHeader> decode_header(std::string_view bytes);

/// `body` must have header.body_size bytes. `unsupported` for a version over 2, `bad_value` for a wrong CRC
/// (figure "crc") or inconsistent content, `truncated` and `bad_size` for inconsistent lengths.
Expected<IgtlMessage> decode(const IgtlHeader& header, std::string_view body);

/// Header and body. Names are truncated to their fields, matrices rounded to 32 bits. Throws
/// std::invalid_argument for metadata whose keys exceed 65,535 bytes.
std::string encode(const IgtlMessage& message);

/// Type in the header, e.g. "TDATA", "STT_TDATA".
std::string type_of(const IgtlContent& content);

/// Rotation and position as a matrix. A quaternion within 1e-3 of unit length is normalised (devices round);
/// any other scales the rotation, so that PoseGate rejects it.
Eigen::Matrix4d matrix_from(const Eigen::Vector3d& position, const Eigen::Vector4d& quaternion);

}  // namespace helicarm::tracker
