// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/big_endian.h"
#include "helicarm/devices/tracker/crc64.h"
#include "helicarm/devices/tracker/igtl_samples_test.h"
#include "helicarm/devices/tracker/igtl_stream.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

/// Sets the checksum of each message, which mutations do not find by chance.
std::string with_check_sums(std::string bytes) {
  for (std::size_t at = 0; bytes.size() >= at + tracker::IgtlHeader::size;) {
    BigEndianReader size(std::string_view(bytes).substr(at + 42, 8));
    const auto body = size.take<std::uint64_t>();
    const std::size_t start = at + tracker::IgtlHeader::size;
    if (body > bytes.size() - start) break;
    const std::uint64_t sum = tracker::crc64(std::string_view(bytes).substr(start, body));
    bytes.replace(at + 50, 8, BigEndianWriter().put(sum).bytes());
    at = start + body;
  }
  return bytes;
}

}  // namespace

void run(std::string_view bytes) {
  Choices choices(bytes);
  const unsigned mode = choices.byte();
  const std::size_t segment = 1 + choices.byte();
  const std::string stream_bytes = mode & 1 ? std::string(bytes) : with_check_sums(std::string(bytes));
  tracker::IgtlStream stream;
  tracker::PoseBoard board;
  double now_s = 1000;
  const auto sink = [&](tracker::IgtlMessage&& message) {
    now_s += 0.02;
    board.take(message, now_s);
    const std::string once = encode(message);
    const auto header = tracker::decode_header(std::string_view(once).substr(0, tracker::IgtlHeader::size));
    check(header.has_value(), "the header of an encoded message can be decoded");
    const auto again = decode(*header, std::string_view(once).substr(tracker::IgtlHeader::size));
    check(again.has_value(), "an encoded message can be decoded");
    check(encode(*again) == once, "encoding is reproducible");
  };
  std::string_view rest = stream_bytes;
  while (!rest.empty()) {
    if (!stream.feed(rest.substr(0, segment), sink)) break;
    rest.remove_prefix(std::min(segment, rest.size()));
  }
  check(stream.held() <= stream_bytes.size(), "the buffer does not exceed the input");
  for (const tracker::ToolState& tool : board.tools(now_s)) {
    if (!tool.tracker_from_tool) continue;
    const Eigen::Matrix3d& rotation = tool.tracker_from_tool->rotation;
    check(tool.tracker_from_tool->matrix().allFinite(), "a pose on the board is finite");
    check((rotation.transpose() * rotation).isIdentity(1e-6), "a pose on the board is rigid");
  }
}

std::vector<std::string> seeds() {
  std::vector<std::string> all;
  std::string together("\0\x40", 2);
  for (tracker::IgtlMessage message : tracker::sample_messages()) {
    all.push_back(std::string("\0\xff", 2) + encode(message));
    together += encode(message);
    message.version = 2;
    message.metadata = {{"key", "value"}, {"status", "OK"}};
    all.push_back(std::string("\0\x07", 2) + encode(message));
  }
  all.push_back(together);
  return all;
}

}  // namespace helicarm::fuzz
