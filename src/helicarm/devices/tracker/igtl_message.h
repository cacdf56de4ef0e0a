// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
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

struct IgtlImage {
  std::uint8_t components = 1;
  std::uint8_t scalar_type = 3;  ///< 2 i8, 3 u8, 4 i16, 5 u16, 6 i32, 7 u32, 10 f32, 11 f64
  std::uint8_t endian = 2;       ///< of the pixels: 1 big, 2 little
  std::uint8_t coordinates = 1;  ///< 1 RAS, 2 LPS
  std::array<std::uint16_t, 3> size{};
  /// Columns: the three axes, each of the length of a pixel, and the centre.
  Eigen::Matrix<double, 3, 4> axes_and_centre = Eigen::Matrix<double, 3, 4>::Identity();
  std::array<std::uint16_t, 3> part_offset{};
  std::array<std::uint16_t, 3> part_size{};
  std::string pixels;  ///< of the sub-volume, in the byte order above
};

struct IgtlPoint {
  std::string name;
  std::string group;
  std::array<std::uint8_t, 4> rgba{};
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double diameter = 0;
  std::string owner;
};
struct IgtlPoints {
  std::vector<IgtlPoint> points;
};

struct IgtlString {
  std::string text;
  std::uint16_t encoding = 3;  ///< MIB number: 3 ASCII, 106 UTF-8
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

using IgtlContent =
    std::variant<IgtlTransform, IgtlTracking, IgtlQuaternions, IgtlPosition, IgtlStatus, IgtlImage,
                 IgtlPoints, IgtlString, IgtlStart, IgtlStop, IgtlGet, IgtlReply, IgtlUnknown>;

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

/// Largest accepted body: 64 MiB for IMAGE (a volume; an X-ray image is 2 MiB), 1 MiB for other types (over
/// 7,000 points).
std::uint64_t body_limit(std::string_view type);

/// The first 58 bytes of a message. `truncated`; `bad_value` if the type is not a name or the version is 0,
/// i.e. this is not a header; `bad_size` for a body above its limit.
Expected<IgtlHeader> decode_header(std::string_view bytes);

/// `body` must have header.body_size bytes. `unsupported` for a version over 2, `bad_value` for a wrong CRC
/// (figure "crc") or inconsistent content, `truncated` and `bad_size` for inconsistent lengths.
Expected<IgtlMessage> decode(const IgtlHeader& header, std::string_view body);

/// Header and body. Names are truncated to their fields, matrices rounded to 32 bits. Throws
/// std::invalid_argument for content that does not fit: text of STRING or keys over 65,535 bytes.
std::string encode(const IgtlMessage& message);

/// Type in the header, e.g. "TDATA", "STT_TDATA".
std::string type_of(const IgtlContent& content);

/// Bytes of one pixel's component; 0 for a type that does not exist.
std::size_t scalar_bytes(std::uint8_t scalar_type);

/// Rotation and position as a matrix. A quaternion within 1e-3 of unit length is normalised (devices round);
/// any other scales the rotation, so that PoseGate rejects it.
Eigen::Matrix4d matrix_from(const Eigen::Vector3d& position, const Eigen::Vector4d& quaternion);

}  // namespace helicarm::tracker
