// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/dimse.h"

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/devices/receiver/peer.h"

namespace helicarm::receiver::dicom {
namespace {

TEST(Command, StoreReportsClassInstanceAndFollowingData) {
  const Command command = read_command(peer::command(1, xa_class, "2.25.17")).value();
  EXPECT_TRUE(command.is(Operation::store));
  EXPECT_EQ(command.message_id, 7);
  EXPECT_EQ(command.sop_class, xa_class);
  EXPECT_EQ(command.sop_instance, "2.25.17");
  EXPECT_TRUE(command.data_set_follows);
}

TEST(Command, EveryTruncationIsRefused) {
  const std::string whole = peer::command(1, xa_class, "2.25.17");
  const std::size_t instance = whole.size() - 16;  // an optional element: without it the command is valid
  for (std::size_t length = 0; length < whole.size(); ++length)
    EXPECT_TRUE(length == instance || !read_command(whole.substr(0, length))) << length;
}

TEST(Command, PathAsInstanceIsRefused) {
  const auto command = read_command(peer::command(1, xa_class, "../../../tmp/x"));
  ASSERT_FALSE(command);
  EXPECT_EQ(command.error().reason, Reason::bad_value);
}

TEST(Command, ElementsOutOfOrderAreRefused) {
  EXPECT_FALSE(read_command(peer::command_element(0x0110, std::string(2, '\1')) +
                            peer::command_element(0x0100, std::string(2, '\1'))));
}

TEST(Command, MutationsNeverCrash) {
  const std::string whole = peer::command(1, xa_class, "2.25.17");
  RandomStream random(1, 2);
  for (int trial = 0; trial < 20000; ++trial) {
    std::string changed = whole;
    for (int i = 0; i < 3; ++i)
      changed[random.index(static_cast<std::uint32_t>(whole.size()))] = static_cast<char>(random.bits());
    if (const auto command = read_command(changed)) {
      EXPECT_LE(command->sop_instance.size(), 64u);
    }
  }
}

TEST(Response, RepeatsTheMessageIdAndContainsTheStatus) {
  const Command command = read_command(peer::command(1, xa_class, "2.25.17")).value();
  const std::string bytes = write_response(command, Status::cannot_understand, "why");
  EXPECT_NE(bytes.find(peer::command_element(0x0100, std::string("\1\x80", 2))), std::string::npos);
  EXPECT_NE(bytes.find(peer::command_element(0x0120, std::string("\7\0", 2))), std::string::npos);
  EXPECT_NE(bytes.find(peer::command_element(0x0900, std::string("\0\xC0", 2))), std::string::npos);
  EXPECT_NE(bytes.find("why "), std::string::npos);
}

}  // namespace
}  // namespace helicarm::receiver::dicom
