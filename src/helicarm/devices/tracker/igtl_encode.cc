// SPDX-License-Identifier: Apache-2.0
#include <limits>
#include <stdexcept>

#include "helicarm/core/big_endian.h"
#include "helicarm/devices/tracker/crc64.h"
#include "helicarm/devices/tracker/igtl_message.h"

namespace helicarm::tracker {
namespace {

constexpr std::uint16_t ascii = 3;  // MIB number of the metadata's encoding

/// A length that fits its field.
template <class Field>
Field length(std::size_t size) {
  if (size > std::numeric_limits<Field>::max()) throw std::invalid_argument("text too long for OpenIGTLink");
  return static_cast<Field>(size);
}

template <class Vector>
void put_floats(BigEndianWriter& out, const Vector& values) {
  for (Eigen::Index i = 0; i < values.size(); ++i) out.put(static_cast<float>(values[i]));
}

void put_matrix(BigEndianWriter& out, const Eigen::Matrix4d& matrix) {
  for (int column = 0; column < 4; ++column) put_floats(out, matrix.col(column).head<3>());
}

struct ContentWriter {
  BigEndianWriter& out;

  void operator()(const IgtlTransform& transform) const { put_matrix(out, transform.matrix); }
  void operator()(const IgtlTracking& tracking) const {
    for (const IgtlTool& tool : tracking.tools) {
      out.put_name(tool.name, 20).put(tool.type).put(std::uint8_t{0});
      put_matrix(out, tool.matrix);
    }
  }
  void operator()(const IgtlQuaternions& tracking) const {
    for (const IgtlQuaternionTool& tool : tracking.tools) {
      out.put_name(tool.name, 20).put(tool.type).put(std::uint8_t{0});
      put_floats(out, tool.position);
      put_floats(out, tool.quaternion);
    }
  }
  void operator()(const IgtlPosition& position) const {
    put_floats(out, position.position);
    if (position.quaternion) put_floats(out, *position.quaternion);
  }
  void operator()(const IgtlStatus& status) const {
    out.put(status.code)
        .put(status.subcode)
        .put_name(status.error_name, 20)
        .put(status.text)
        .put(std::uint8_t{0});
  }
  void operator()(const IgtlStart& start) const {
    out.put(start.interval_ms).put_name(start.coordinates, 32);
  }
  void operator()(const IgtlStop&) const {}
  void operator()(const IgtlGet&) const {}
  void operator()(const IgtlReply& reply) const { out.put(reply.status); }
  void operator()(const IgtlUnknown& unknown) const { out.put(unknown.content); }
};

std::string body_of(const IgtlMessage& message) {
  BigEndianWriter content;
  std::visit(ContentWriter{content}, message.content);
  if (message.version == 1) return std::move(content).bytes();
  BigEndianWriter entries, texts;
  entries.put(length<std::uint16_t>(message.metadata.size()));
  for (const auto& [key, value] : message.metadata) {
    entries.put(length<std::uint16_t>(key.size())).put(ascii).put(length<std::uint32_t>(value.size()));
    texts.put(key).put(value);
  }
  return BigEndianWriter()
      .put(std::uint16_t{12})
      .put(length<std::uint16_t>(entries.bytes().size()))
      .put(length<std::uint32_t>(texts.bytes().size()))
      .put(message.id)
      .put(content.bytes())
      .put(entries.bytes())
      .put(texts.bytes())
      .bytes();
}

}  // namespace

std::string encode(const IgtlMessage& message) {
  const std::string body = body_of(message);
  return BigEndianWriter()
      .put(message.version)
      .put_name(type_of(message.content), 12)
      .put_name(message.device, 20)
      .put(message.stamp)
      .put(std::uint64_t{body.size()})
      .put(crc64(body))
      .put(body)
      .bytes();
}

}  // namespace helicarm::tracker
