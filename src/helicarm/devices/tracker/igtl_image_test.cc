// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/igtl_image.h"

#include <array>

#include <gtest/gtest.h>

#include "helicarm/core/big_endian.h"

namespace helicarm::tracker {
namespace igtl_image_test {

constexpr std::array<std::uint16_t, 6> grey{1, 2, 3, 0x0405, 5, 6};

std::string content_of(const IgtlMessage& message) { return std::get<IgtlUnknown>(message.content).content; }

TEST(IgtlImage, HasTheLayoutOfTheFormat) {
  const IgtlMessage message = image_message("AP", {grey, 3, 2, {0.5, 0, 0}, {0, 0, 0.25}, {7, 8, 9}});
  EXPECT_EQ(message.device, "AP");
  EXPECT_EQ(type_of(message.content), "IMAGE");
  const std::string content = content_of(message);
  ASSERT_EQ(content.size(), 72U + 12U);
  BigEndianReader in(content);
  EXPECT_EQ(in.take<std::uint16_t>(), 1);
  for (const int expected : {1, 5, 1, 1}) EXPECT_EQ(in.take<std::uint8_t>(), expected);
  for (const int expected : {3, 2, 1}) EXPECT_EQ(in.take<std::uint16_t>(), expected);
  for (const float expected : {0.5F, 0.F, 0.F, 0.F, 0.F, 0.25F, 0.F, -1.F, 0.F, 7.F, 8.F, 9.F})
    EXPECT_EQ(in.take<float>(), expected);
  for (const int expected : {0, 0, 0, 3, 2, 1}) EXPECT_EQ(in.take<std::uint16_t>(), expected);
  for (const std::uint16_t expected : grey) EXPECT_EQ(in.take<std::uint16_t>(), expected);
}

TEST(IgtlImage, IsFramedAsEveryMessage) {
  const std::string bytes = encode(image_message("AP", {grey, 3, 2}));
  const auto header = decode_header(bytes);
  ASSERT_TRUE(header);
  EXPECT_EQ(header->type, "IMAGE");
  EXPECT_TRUE(decode(*header, bytes.substr(IgtlHeader::size)));
}

TEST(IgtlImage, ASizeThatIsNotThatOfThePixelsIsRefused) {
  EXPECT_THROW(image_message("AP", {grey, 3, 3}), std::invalid_argument);
  EXPECT_THROW(image_message("AP", {{}, 0, 0}), std::invalid_argument);
}

}  // namespace igtl_image_test
}  // namespace helicarm::tracker
