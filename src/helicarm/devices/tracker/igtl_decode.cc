// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/big_endian.h"
#include "helicarm/core/text.h"
#include "helicarm/devices/tracker/crc64.h"
#include "helicarm/devices/tracker/igtl_message.h"

namespace helicarm::tracker {
namespace {

constexpr std::size_t extended_header_size = 12;
constexpr std::size_t metadata_entry_size = 8;
constexpr std::size_t tool_size = 70;
constexpr std::size_t quaternion_tool_size = 50;

/// Text of a field, limited to characters that can be shown or looked up.
std::string take_text(BigEndianReader& in, std::size_t width) {
  return without_control_characters(std::string(in.take_name(width)));
}

template <int size>
Eigen::Matrix<double, size, 1> take_floats(BigEndianReader& in) {
  Eigen::Matrix<double, size, 1> values;
  for (double& value : values) value = in.take<float>();
  return values;
}

Eigen::Matrix4d take_matrix(BigEndianReader& in) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  for (int column = 0; column < 4; ++column) matrix.col(column).head<3>() = take_floats<3>(in);
  return matrix;
}

/// Number of elements of one size in the rest.
std::size_t element_count(const BigEndianReader& in, std::size_t element, std::string_view type) {
  if (in.left() % element != 0)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} bytes are not a multiple of {}", type, in.left(), element));
  return in.left() / element;
}

IgtlTracking take_tracking(BigEndianReader& in) {
  IgtlTracking tracking;
  tracking.tools.resize(element_count(in, tool_size, "TDATA"));
  for (IgtlTool& tool : tracking.tools) {
    tool.name = take_text(in, 20);
    tool.type = in.take<std::uint8_t>();
    in.take(1);
    tool.matrix = take_matrix(in);
  }
  return tracking;
}

IgtlQuaternions take_quaternions(BigEndianReader& in) {
  IgtlQuaternions tracking;
  tracking.tools.resize(element_count(in, quaternion_tool_size, "QTDATA"));
  for (IgtlQuaternionTool& tool : tracking.tools) {
    tool.name = take_text(in, 20);
    tool.type = in.take<std::uint8_t>();
    in.take(1);
    tool.position = take_floats<3>(in);
    tool.quaternion = take_floats<4>(in);
  }
  return tracking;
}

/// Bodies of 12 and 24 bytes are the protocol's short forms: a point, and a unit quaternion without its w.
IgtlPosition take_position(BigEndianReader& in) {
  IgtlPosition position;
  const std::size_t size = in.left();
  position.position = take_floats<3>(in);
  if (size == 24) {
    const Eigen::Vector3d vector = take_floats<3>(in);
    position.quaternion = Eigen::Vector4d(vector.x(), vector.y(), vector.z(),
                                          std::sqrt(std::max(0.0, 1 - vector.squaredNorm())));
  } else if (size != 12) {
    position.quaternion = take_floats<4>(in);
  }
  return position;
}

IgtlStatus take_status(BigEndianReader& in) {
  IgtlStatus status;
  status.code = in.take<std::uint16_t>();
  status.subcode = in.take<std::int64_t>();
  status.error_name = take_text(in, 20);
  status.text = take_text(in, in.left());
  return status;
}

IgtlStart take_start(BigEndianReader& in, std::string what) {
  IgtlStart start;
  start.what = std::move(what);
  start.interval_ms = in.take<std::int32_t>();
  start.coordinates = take_text(in, 32);
  return start;
}

IgtlContent take_content(BigEndianReader& in, const std::string& type) {
  if (type == "TRANSFORM") return IgtlTransform{take_matrix(in)};
  if (type == "TDATA") return take_tracking(in);
  if (type == "QTDATA") return take_quaternions(in);
  if (type == "POSITION" || type == "QTRANS") return take_position(in);
  if (type == "STATUS") return take_status(in);
  if (type == "STT_TDATA" || type == "STT_QTDATA") return take_start(in, type.substr(4));
  if (type.starts_with("STP_")) return IgtlStop{type.substr(4)};
  if (type.starts_with("GET_")) return IgtlGet{type.substr(4)};
  if (type == "RTS_TDATA" || type == "RTS_QTDATA") return IgtlReply{type.substr(4), in.take<std::uint8_t>()};
  return IgtlUnknown{type, std::string(in.take(in.left()))};
}

std::map<std::string, std::string> take_metadata(std::string_view head, std::string_view data) {
  std::map<std::string, std::string> metadata;
  if (head.empty()) return metadata;
  BigEndianReader entries(head), texts(data);
  const std::size_t count = entries.take<std::uint16_t>();
  if (entries.left() != count * metadata_entry_size)
    throw BadInput(Reason::bad_size, fmt::format("metadata: {} entries in {} bytes", count, entries.left()));
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t key_size = entries.take<std::uint16_t>();
    entries.take(2);  // the encoding: relevant keys are ASCII
    const std::size_t value_size = entries.take<std::uint32_t>();
    std::string key(texts.take(key_size));
    if (!metadata.emplace(std::move(key), texts.take(value_size)).second)
      throw BadInput(Reason::name_clash, "metadata: a key is given twice");
  }
  return metadata;
}

IgtlMessage take_message(const IgtlHeader& header, std::string_view body) {
  if (header.version > 2)
    throw BadInput(Reason::unsupported, fmt::format("header version {}", header.version));
  if (body.size() != header.body_size)
    throw BadInput(Reason::truncated,
                   fmt::format("body of {} bytes, {} announced", body.size(), header.body_size));
  if (crc64(body) != header.crc)
    throw BadInput({Reason::bad_value, header.type + ": wrong checksum", {}, {{"crc", 1}}});
  IgtlMessage message{header.device, header.stamp, {}, header.version};
  BigEndianReader in(body);
  if (header.version == 2) {
    const std::size_t head_size = in.take<std::uint16_t>();
    const std::size_t entries_size = in.take<std::uint16_t>();
    const std::size_t texts_size = in.take<std::uint32_t>();
    message.id = in.take<std::uint32_t>();
    if (head_size < extended_header_size)
      throw BadInput(Reason::bad_size, fmt::format("extended header of {} bytes", head_size));
    in.take(head_size - extended_header_size);  // fields of a later revision
    if (entries_size + texts_size > in.left())
      throw BadInput(Reason::truncated,
                     fmt::format("{} bytes of metadata in {}", entries_size + texts_size, in.left()));
    BigEndianReader content(in.take(in.left() - entries_size - texts_size));
    const std::string_view entries = in.take(entries_size);
    message.metadata = take_metadata(entries, in.take(texts_size));
    in = content;
  }
  message.content = take_content(in, header.type);
  // Requests are empty by the protocol, but some peers send content.
  const bool request = header.type.starts_with("GET_") || header.type.starts_with("STP_");
  if (in.left() != 0 && !request)
    throw BadInput(Reason::bad_size, fmt::format("{}: {} bytes too long", header.type, in.left()));
  return message;
}

bool is_type_name(std::string_view type) {
  return !type.empty() && std::ranges::all_of(type, [](char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
  });
}

}  // namespace

Expected<IgtlHeader> decode_header(std::string_view bytes) {
  return guarded([&] {
    BigEndianReader in(bytes);
    IgtlHeader header;
    header.version = in.take<std::uint16_t>();
    header.type = in.take_name(12);
    header.device = take_text(in, 20);
    header.stamp = in.take<std::uint64_t>();
    header.body_size = in.take<std::uint64_t>();
    header.crc = in.take<std::uint64_t>();
    if (header.version == 0 || !is_type_name(header.type))
      throw BadInput(Reason::bad_value, "not an OpenIGTLink header");
    if (header.body_size > body_limit(header.type))
      throw BadInput({Reason::bad_size,
                      fmt::format("{}: body of {} bytes, limit {}", header.type, header.body_size,
                                  body_limit(header.type)),
                      {},
                      {{"body_size", static_cast<double>(header.body_size)}}});
    return header;
  });
}

Expected<IgtlMessage> decode(const IgtlHeader& header, std::string_view body) {
  return guarded([&] { return take_message(header, body); });
}

}  // namespace helicarm::tracker
