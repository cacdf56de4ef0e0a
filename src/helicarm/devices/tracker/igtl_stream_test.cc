// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/igtl_stream.h"

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/devices/tracker/igtl_samples_test.h"

namespace helicarm::tracker {
namespace igtl_stream_test {

std::string all_samples() {
  std::string bytes;
  for (const IgtlMessage& message : sample_messages()) bytes += encode(message);
  return bytes;
}

struct Collector {
  std::string again;
  IgtlStream stream;

  Expected<void> feed(std::string_view bytes) {
    return stream.feed(bytes, [this](IgtlMessage&& message) { again += encode(message); });
  }
};

TEST(IgtlStream, ResultIsIndependentOfSegmentation) {
  const std::string bytes = all_samples();
  RandomStream random(5, 0);
  for (const std::uint32_t longest : {1u, 2u, 57u, 59u, 400u, 100000u}) {
    Collector collector;
    for (std::size_t at = 0; at < bytes.size();) {
      const std::size_t size = longest == 1 ? 1 : 1 + random.index(longest);
      ASSERT_TRUE(collector.feed(std::string_view(bytes).substr(at, size)));
      at += size;
    }
    EXPECT_EQ(collector.again, bytes);
    EXPECT_EQ(collector.stream.held(), 0u);
    EXPECT_EQ(collector.stream.counters().at("messages"), sample_messages().size());
  }
}

TEST(IgtlStream, IncompleteMessageWaits) {
  Collector collector;
  const std::string bytes = encode(sample_messages()[0]);
  ASSERT_TRUE(collector.feed(bytes.substr(0, 80)));
  EXPECT_EQ(collector.again, "");
  ASSERT_TRUE(collector.feed(bytes.substr(80)));
  EXPECT_EQ(collector.again, bytes);
}

TEST(IgtlStream, AnnouncedLengthAllocatesNoMemory) {
  Collector collector;
  IgtlMessage image{"i", 0, IgtlUnknown{"IMAGE", std::string(1 << 20, 'x')}};
  ASSERT_TRUE(collector.feed(encode(image).substr(0, 100)));
  EXPECT_LT(collector.stream.held(), 100u);
}

TEST(IgtlStream, MemoryOfALargeMessageIsReleased) {
  Collector collector;
  const std::string large = encode({"i", 0, IgtlUnknown{"LARGE", std::string(1 << 20, 'x')}});
  for (std::size_t at = 0; at < large.size(); at += 1000)
    ASSERT_TRUE(collector.feed(std::string_view(large).substr(at, 1000)));
  EXPECT_EQ(collector.again, large);
  EXPECT_LT(collector.stream.memory(), std::size_t{1} << 17);
}

TEST(IgtlStream, BodyAboveItsLimitEndsTheStream) {
  IgtlStream stream(100);
  const auto ignore = [](IgtlMessage&&) {};
  EXPECT_TRUE(stream.feed(encode({"i", 0, IgtlUnknown{"LARGE", std::string(100, 'x')}}), ignore));
  EXPECT_EQ(stream.feed(encode({"i", 0, IgtlUnknown{"LARGE", std::string(101, 'x')}}), ignore).error().reason,
            Reason::bad_size);
}

TEST(IgtlStream, DamagedMessageIsDroppedAndTheNextOneRead) {
  const std::string sound = encode(sample_messages()[0]);
  std::string spoiled = sound, newer = sound;
  spoiled[70] ^= 4;
  newer[1] = 9;
  Collector collector;
  ASSERT_TRUE(collector.feed(spoiled + sound + newer + sound + encode(sample_messages().back())));
  EXPECT_EQ(collector.stream.counters(),
            (Counters{{"messages", 3}, {"wrong_crc", 1}, {"unsupported_version", 1}, {"unknown_type", 1}}));
}

TEST(IgtlStream, ConsecutiveWrongChecksumsEndTheStream) {
  std::string spoiled = encode(sample_messages()[0]);
  spoiled[70] ^= 4;
  Collector collector;
  for (int i = 1; i < IgtlStream::max_wrong_crcs; ++i) ASSERT_TRUE(collector.feed(spoiled));
  EXPECT_FALSE(collector.feed(spoiled));
}

TEST(IgtlStream, InvalidHeaderEndsTheStream) {
  EXPECT_EQ(Collector().feed(std::string(58, '\0')).error().reason, Reason::bad_value);
  std::string huge = encode(sample_messages()[0]);
  huge[42] = '\x80';
  EXPECT_EQ(Collector().feed(huge).error().reason, Reason::bad_size);
}

TEST(IgtlStream, AnyBytesAreAcceptedOrRefused) {
  RandomStream random(6, 0);
  const std::string sound = all_samples();
  for (int trial = 0; trial < 2000; ++trial) {
    std::string bytes = sound;
    for (std::uint32_t i = random.index(10); i > 0; --i)
      bytes[random.index(static_cast<std::uint32_t>(bytes.size()))] = static_cast<char>(random.index(256));
    Collector collector;
    for (std::size_t at = 0; at < bytes.size(); at += 300)
      if (!collector.feed(std::string_view(bytes).substr(at, 300))) break;
  }
}

}  // namespace igtl_stream_test
}  // namespace helicarm::tracker
