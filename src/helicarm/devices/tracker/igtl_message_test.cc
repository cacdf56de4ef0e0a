// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/igtl_message.h"

#include <gtest/gtest.h>

#include "helicarm/core/big_endian.h"
#include "helicarm/core/random.h"
#include "helicarm/devices/tracker/crc64.h"
#include "helicarm/devices/tracker/igtl_samples_test.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace igtl_message_test {

/// The library's sample TRANSFORM body (protocol 1), which is not a rotation.
constexpr std::string_view sample_body_hex =
    "BF7473CD3E4959E6BE63DD98BE4959E63E12491B3F7852D63E63DD983F7852D6BDC830AE42383660419BC46742383660";

std::string from_hex(std::string_view hex) {
  std::string bytes;
  for (std::size_t i = 0; i < hex.size(); i += 2)
    bytes += static_cast<char>(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16));
  return bytes;
}

Expected<IgtlMessage> decode_whole(std::string_view bytes) {
  const auto header = decode_header(bytes);
  if (!header) return tl::unexpected(header.error());
  return decode(*header, bytes.substr(IgtlHeader::size));
}

/// A message with this body and a correct checksum.
std::string framed(std::string_view type, std::string_view body, std::uint16_t version = 1) {
  return BigEndianWriter()
      .put(version)
      .put_name(type, 12)
      .put_name("device", 20)
      .put(std::uint64_t{0})
      .put(std::uint64_t{body.size()})
      .put(crc64(body))
      .put(body)
      .bytes();
}

Reason reason_of(std::string_view bytes) {
  const auto message = decode_whole(bytes);
  EXPECT_FALSE(message);
  return message ? Reason::usage : message.error().reason;
}

TEST(Crc64, HasTheKnownCheckValues) {
  EXPECT_EQ(crc64("123456789"), 0x6C40DF5F0B497347u);
  EXPECT_EQ(crc64(from_hex(sample_body_hex)), 0xF6DD2B8EB4DF6DD2u);
  EXPECT_EQ(crc64(""), 0u);
}

TEST(IgtlMessage, KnownBytesAreDecodedAndEncoded) {
  const std::string bytes = framed("TRANSFORM", from_hex(sample_body_hex));
  const auto message = decode_whole(bytes);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->device, "device");
  const Eigen::Matrix4d& matrix = std::get<IgtlTransform>(message->content).matrix;
  EXPECT_FLOAT_EQ(matrix(0, 0), -0.954892f);
  EXPECT_FLOAT_EQ(matrix(1, 0), 0.196632f);
  EXPECT_FLOAT_EQ(matrix(0, 3), 46.0531f);
  EXPECT_EQ(encode(*message), bytes);
}

TEST(IgtlMessage, EveryKindRoundTrips) {
  for (const std::uint16_t version : {1, 2})
    for (IgtlMessage message : sample_messages()) {
      message.version = version;
      if (version == 2) {
        message.id = 77;
        message.metadata = {{"TransformStatus", "OK"}, {"", ""}};
      }
      const std::string bytes = encode(message);
      const auto back = decode_whole(bytes);
      ASSERT_TRUE(back) << type_of(message.content) << ": " << back.error().message;
      EXPECT_EQ(type_of(back->content), type_of(message.content));
      EXPECT_EQ(back->metadata, message.metadata);
      EXPECT_EQ(back->id, message.id);
      EXPECT_EQ(back->stamp, message.stamp);
      EXPECT_EQ(encode(*back), bytes) << type_of(message.content);
    }
}

TEST(IgtlMessage, ExtendedHeaderPrecedesAndMetadataFollowTheContent) {
  const std::string body = BigEndianWriter()
                               .put(std::uint16_t{12})
                               .put(std::uint16_t{10})
                               .put(std::uint32_t{4})
                               .put(std::uint32_t{9})
                               .put(from_hex("00030002"))
                               .put("ab")
                               .put(from_hex("0001000200030000"))
                               .put(from_hex("0002"))
                               .put("keOK")
                               .bytes();
  const auto message = decode_whole(framed("STRING", body, 2));
  ASSERT_TRUE(message) << message.error().message;
  EXPECT_EQ(message->id, 9u);
  EXPECT_EQ(std::get<IgtlUnknown>(message->content).content, from_hex("00030002") + "ab");
  EXPECT_EQ(message->metadata.at("ke"), "OK");
}

TEST(IgtlMessage, NameThatFillsItsFieldHasNoNul) {
  const IgtlTool tool{"twenty characters xx"};
  IgtlMessage message{"another name of 20 c", 0, IgtlTracking{{tool, tool}}};
  const auto back = decode_whole(encode(message));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->device, message.device);
  EXPECT_EQ(std::get<IgtlTracking>(back->content).tools[1].name, tool.name);
}

TEST(IgtlMessage, WrongChecksumIsReported) {
  std::string bytes = encode(sample_messages()[0]);
  bytes.back() ^= 1;
  const auto message = decode_whole(bytes);
  ASSERT_FALSE(message);
  EXPECT_TRUE(message.error().figures.contains("crc"));
}

TEST(IgtlMessage, InconsistentLengthsAreRefused) {
  EXPECT_EQ(reason_of(framed("TRANSFORM", std::string(47, '\0'))), Reason::truncated);
  EXPECT_EQ(reason_of(framed("TRANSFORM", std::string(49, '\0'))), Reason::bad_size);
  EXPECT_EQ(reason_of(framed("TRANSFORM", "")), Reason::truncated);
  EXPECT_EQ(reason_of(framed("TDATA", std::string(71, '\0'))), Reason::bad_size);
  EXPECT_EQ(reason_of(framed("STATUS", std::string(29, '\0'))), Reason::truncated);
  EXPECT_EQ(reason_of(framed("STT_TDATA", std::string(35, '\0'))), Reason::truncated);
  EXPECT_EQ(reason_of(framed("TRANSFORM", std::string(48, '\0'), 9)), Reason::unsupported);
  std::string header = framed("TRANSFORM", "").substr(0, 42);
  EXPECT_EQ(reason_of(header + from_hex("8000000000000000") + std::string(8, '\0')), Reason::bad_size);
  EXPECT_EQ(reason_of("GET / HTTP/1.1\r\nHost: somewhere.example\r\nUser-Agent: someone\r\n\r\n"),
            Reason::bad_value);
}

TEST(IgtlMessage, MetadataBeyondTheBodyAreRefused) {
  const auto with_sizes = [](const char* sizes) {
    return reason_of(framed("STRING", from_hex(sizes) + from_hex("000000000003000161"), 2));
  };
  EXPECT_EQ(with_sizes("000CFFFF00000000"), Reason::truncated);
  EXPECT_EQ(with_sizes("000C0002FFFFFFFF"), Reason::truncated);
  EXPECT_EQ(with_sizes("000B000000000000"), Reason::bad_size);
  EXPECT_EQ(with_sizes("FFFF000000000000"), Reason::truncated);
  EXPECT_EQ(with_sizes("000C000100000000"), Reason::truncated);
  // Key and value lengths whose sum wraps in 32 bits.
  EXPECT_EQ(reason_of(framed("STRING",
                             from_hex("000C000A00000001000000000003000161"
                                      "00010001000"
                                      "3FFFFFFFF"
                                      "61"),
                             2)),
            Reason::truncated);
}

TEST(IgtlMessage, MutationsAreDecodedOrRefusedWithoutOverread) {
  RandomStream random(41, 0);
  const auto samples = sample_messages();
  int read = 0, refused = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    IgtlMessage sample = samples[random.index(static_cast<std::uint32_t>(samples.size()))];
    sample.version = static_cast<std::uint16_t>(1 + random.index(2));
    if (sample.version == 2) sample.metadata = {{"key", "value"}};
    const std::string sound = encode(sample);
    std::string body = sound.substr(IgtlHeader::size);
    for (std::uint32_t i = random.index(6); i > 0 && !body.empty(); --i)
      body[random.index(static_cast<std::uint32_t>(body.size()))] = static_cast<char>(random.index(256));
    if (random.index(4) == 0) body.resize(random.index(static_cast<std::uint32_t>(body.size() + 40)));
    const auto header = decode_header(sound);
    ASSERT_TRUE(header);
    const auto message = decode_whole(framed(header->type, body, sample.version));
    ++(message ? read : refused);
    if (message) encode(*message);
  }
  EXPECT_GT(read, 1000);
  EXPECT_GT(refused, 1000);
}

TEST(IgtlMessage, QuaternionIsNormalisedWithinRounding) {
  const Eigen::Matrix3d rotation = geometry::rotation_from_vector({0.3, -0.2, 1.0});
  const Eigen::Quaterniond q(rotation);
  for (const double scale : {1.0, 1.0009, -1.0})
    EXPECT_LT((matrix_from({1, 2, 3}, scale * q.coeffs()).topLeftCorner<3, 3>() - rotation).norm(), 1e-12);
  EXPECT_NEAR((matrix_from({1, 2, 3}, 1.01 * q.coeffs()).topLeftCorner<3, 3>() - 1.01 * rotation).norm(), 0,
              1e-12);
  EXPECT_TRUE((matrix_from({0, 0, 0}, Eigen::Vector4d::Zero()).topLeftCorner<3, 3>().isZero()));
}

TEST(IgtlMessage, TimeStampIsABinaryFractionOfSeconds) {
  EXPECT_EQ(seconds_from_stamp(0x0000000180000000u), 1.5);
  EXPECT_EQ(stamp_from_seconds(1.5), 0x0000000180000000u);
  EXPECT_NEAR(seconds_from_stamp(stamp_from_seconds(1.8e9 + 0.123456)), 1.8e9 + 0.123456, 3e-7);
  EXPECT_EQ(stamp_from_seconds(-1), 0u);
  EXPECT_EQ(stamp_from_seconds(std::nan("")), 0u);
}

}  // namespace igtl_message_test
}  // namespace helicarm::tracker
