// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/tar_gz.h"

#include <stdexcept>

#include <gtest/gtest.h>
#include <zlib.h>

namespace helicarm::pipeline {
namespace {

std::string unpacked(std::string packed) {
  std::string bytes(1 << 20, '\0');
  z_stream stream{};
  EXPECT_EQ(inflateInit2(&stream, 15 + 16), Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(bytes.data());
  stream.avail_out = static_cast<uInt>(bytes.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  bytes.resize(stream.total_out);
  inflateEnd(&stream);
  return bytes;
}

TEST(TarGz, HoldsNamesSizesAndBytesInBlocks) {
  const std::vector<ArchivedFile> files{{"a/one.txt", "first"}, {"two", std::string(600, 'x')}};
  const std::string tar = unpacked(tar_gz(files));
  ASSERT_EQ(tar.size(), 512u * (1 + 1 + 1 + 2 + 2));
  EXPECT_STREQ(tar.data(), "a/one.txt");
  EXPECT_EQ(tar.substr(124, 11), "00000000005");
  EXPECT_EQ(tar.substr(512, 5), "first");
  EXPECT_STREQ(tar.data() + 1024, "two");
  EXPECT_EQ(tar.substr(1024 + 124, 11), "00000001130");
}

TEST(TarGz, HeadersSumIsRight) {
  std::string header = unpacked(tar_gz(std::vector<ArchivedFile>{{"one", ""}})).substr(0, 512);
  const unsigned stated = unsigned(std::stoul(header.substr(148, 6), nullptr, 8));
  header.replace(148, 8, 8, ' ');
  unsigned sum = 0;
  for (const char c : header) sum += static_cast<unsigned char>(c);
  EXPECT_EQ(stated, sum);
}

TEST(TarGz, NameThatIsTooLongIsRefused) {
  EXPECT_THROW(tar_gz(std::vector<ArchivedFile>{{std::string(101, 'x'), ""}}), std::invalid_argument);
}

}  // namespace
}  // namespace helicarm::pipeline
