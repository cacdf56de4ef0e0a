// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/ndi_message.h"

#include <random>

#include <gmock/gmock.h>

namespace helicarm::tracker {
namespace ndi_message_test {

using Eigen::Vector3d;
using Eigen::Vector4d;

// CRCs that NDI's API guide prints.
TEST(NdiMessage, CommandsAndRepliesHaveTheCrcOfTheGuide) {
  EXPECT_EQ(ndi_command("INIT"), "INIT:E3A5\r");
  EXPECT_EQ(ndi_text_reply(std::string_view("OKAY")), "OKAYA896\r");
  EXPECT_EQ(ndi_text("RESETBE6F\r").value(), "RESET");
}

// Made by hand from the guide's layout: two tools, the second missing.
TEST(NdiMessage, TextOfTwoToolsIsRead) {
  const std::string text =
      "020A+07071-00012+00000+07071+012345-000678-150000+00123000000310000ABCD\n"
      "0BMISSING000000310000ABCD\n0200";
  const auto tracking = ndi_tracking(ndi_text_reply(std::string_view(text)));
  ASSERT_TRUE(tracking) << tracking.error().message;
  ASSERT_EQ(tracking->tools.size(), 2u);
  const NdiTool& first = tracking->tools[0];
  EXPECT_EQ(first.handle, 10);
  EXPECT_EQ(first.state, NdiToolState::valid);
  EXPECT_LT((first.quaternion - Vector4d(-0.0012, 0, 0.7071, 0.7071)).norm(), 1e-12);
  EXPECT_LT((first.position - Vector3d(123.45, -6.78, -1500)).norm(), 1e-9);
  EXPECT_NEAR(first.error_mm, 0.0123, 1e-12);
  EXPECT_EQ(first.port_status, 0x31u);
  EXPECT_EQ(first.frame, 0xABCDu);
  EXPECT_EQ(tracking->tools[1].state, NdiToolState::missing);
  EXPECT_EQ(ndi_trouble(tracking->system_status), "temperature out of range");
}

// Likewise: one valid tool at (1, -2, 0.5) mm with the quaternion (1, 0, 0, 0), one disabled.
TEST(NdiMessage, BytesOfTwoToolsAreRead) {
  using namespace std::string_literals;
  const std::string data =
      "\x02\x01\x01\x00\x00\x80\x3f\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00"
      "\x00\x00\x80\x3f\x00\x00\x00\xc0\x00\x00\x00\x3f\x00\x00\x00\x3e"
      "\x31\x00\x00\x00\x07\x01\x00\x00\x02\x04\x00\x00"s;
  std::string reply = "\xc4\xa5"s + char(data.size()) + '\0';
  const auto add_crc = [&](std::string_view of) {
    const std::uint16_t crc = ndi_crc(of);
    reply += char(crc & 0xFF);
    reply += char(crc >> 8);
  };
  add_crc(std::string(reply));
  reply += data;
  add_crc(data);
  EXPECT_EQ(ndi_reply_size(reply).value(), reply.size());
  const auto tracking = ndi_tracking(reply);
  ASSERT_TRUE(tracking) << tracking.error().message;
  ASSERT_EQ(tracking->tools.size(), 2u);
  EXPECT_EQ(tracking->tools[0].position, Vector3d(1, -2, 0.5));
  EXPECT_EQ(tracking->tools[0].quaternion, Vector4d(0, 0, 0, 1));
  EXPECT_EQ(tracking->tools[0].error_mm, 0.125);
  EXPECT_EQ(tracking->tools[0].frame, 0x107u);
  EXPECT_EQ(tracking->tools[1].state, NdiToolState::disabled);
}

NdiTracking random_tracking(std::mt19937& random) {
  std::normal_distribution<double> normal;
  NdiTracking tracking;
  for (int i = 0; i < 5; ++i) {
    NdiTool tool;
    tool.handle = 1 + i;
    tool.state = static_cast<NdiToolState>(random() % 3);
    if (tool.state == NdiToolState::valid) {
      tool.quaternion = Vector4d(normal(random), normal(random), normal(random), normal(random)).normalized();
      tool.position = 800 * Vector3d(normal(random), normal(random), normal(random));
      tool.error_mm = 0.1;
    }
    if (tool.state != NdiToolState::disabled) tool.frame = std::uint32_t(random());
    tracking.tools.push_back(tool);
  }
  return tracking;
}

void expect_alike(const NdiTracking& read, const NdiTracking& written, double mm, double quaternion) {
  ASSERT_EQ(read.tools.size(), written.tools.size());
  for (std::size_t i = 0; i < read.tools.size(); ++i) {
    EXPECT_EQ(read.tools[i].state, written.tools[i].state);
    EXPECT_EQ(read.tools[i].frame, written.tools[i].frame);
    EXPECT_LE((read.tools[i].position - written.tools[i].position).cwiseAbs().maxCoeff(), mm);
    EXPECT_LE((read.tools[i].quaternion - written.tools[i].quaternion).cwiseAbs().maxCoeff(), quaternion);
  }
}

TEST(NdiMessage, WrittenRepliesAreReadBack) {
  std::mt19937 random(1);
  for (int i = 0; i < 100; ++i) {
    const NdiTracking tracking = random_tracking(random);
    expect_alike(ndi_tracking(ndi_binary_reply(tracking)).value(), tracking, 3e-4, 1e-7);
    expect_alike(ndi_tracking(ndi_text_reply(tracking)).value(), tracking, 0.0051, 5.1e-5);
  }
}

TEST(NdiMessage, ReplyThatChangedOnItsWayIsRefused) {
  std::mt19937 random(2);
  for (int i = 0; i < 2000; ++i) {
    const NdiTracking tracking = random_tracking(random);
    std::string reply = i % 2 == 0 ? ndi_binary_reply(tracking) : ndi_text_reply(tracking);
    const std::size_t place = random() % reply.size();
    reply[place] = char(reply[place] ^ (1 << random() % 8));
    if (const auto size = ndi_reply_size(reply); size && *size == reply.size()) {
      // Only the case of a CRC's digit may change.
      if (const auto read = ndi_tracking(reply))
        expect_alike(*read, *ndi_tracking(i % 2 == 0 ? ndi_binary_reply(tracking) : ndi_text_reply(tracking)),
                     0, 0);
    }
  }
}

TEST(NdiMessage, PartOfAReplyIsNotWhole) {
  std::mt19937 random(3);
  const std::string reply = ndi_binary_reply(random_tracking(random));
  for (std::size_t size = 0; size < reply.size(); ++size)
    EXPECT_EQ(ndi_reply_size(std::string_view(reply).substr(0, size)).value(), std::nullopt);
}

TEST(NdiMessage, EndlessReplyIsRefused) {
  EXPECT_EQ(ndi_reply_size(std::string(70000, 'A')).error().reason, Reason::bad_size);
}

TEST(NdiMessage, ErrorOfTheDeviceIsSaidInWords) {
  const auto reply = ndi_text(ndi_text_reply(std::string_view("ERROR0D")));
  ASSERT_FALSE(reply);
  EXPECT_THAT(reply.error().message, testing::HasSubstr("error 0D: no tool in the port"));
}

}  // namespace ndi_message_test
}  // namespace helicarm::tracker
