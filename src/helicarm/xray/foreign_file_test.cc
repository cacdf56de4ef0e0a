// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/foreign_file.h"

#include <gtest/gtest.h>

namespace helicarm::xray {
namespace {

using namespace std::literals;

TEST(ForeignFile, IsNamedByItsFirstBytes) {
  for (const auto& [bytes, word] : {std::pair{"GIF89a"s, "GIF"},
                                    {"RIFF\x10\0\0\0WEBPVP8 "s, "WebP"},
                                    {"RIFF\x10\0\0\0AVI LIST"s, "AVI"},
                                    {"\0\0\0\x18"
                                     "ftypmp42"s,
                                     "MP4"},
                                    {"\0\0\0\x18"
                                     "ftypheic"s,
                                     "HEIC"},
                                    {"\0\0\0\x08"
                                     "wide"s,
                                     "QuickTime"},
                                    {"\x1F\x8B\x08\0"s, "gzip"},
                                    {"NRRD0005\n"s, "NRRD"},
                                    {"\x1C\2\0\0n+2\0\r\n\x1A\n"s, "NIfTI"},
                                    {"%PDF-1.4"s, "PDF"},
                                    {"PK\3\4"s, "ZIP"},
                                    {"{\"a\": 1}"s, "JSON"},
                                    {"\xEF\xBB\xBF{\"a\": 1}"s, "JSON"},
                                    {"<?xml version"s, "XML"},
                                    {"plain words"s, "text"}}) {
    const auto name = foreign_file(bytes);
    ASSERT_TRUE(name) << word;
    EXPECT_NE(name->find(word), std::string::npos) << *name;
    EXPECT_NE(name->find(';'), std::string::npos) << *name;
  }
}

TEST(ForeignFile, ContainersOfFilmsAreThoseOfFfmpeg) {
  EXPECT_EQ(film_container("RIFF\x10\0\0\0AVI LIST"s), "avi");
  EXPECT_EQ(film_container("\0\0\0\x18"
                           "ftypqt  "s),
            "mov");
  EXPECT_EQ(film_container("\0\0\0\x18"
                           "ftypheic"s),
            "");
  EXPECT_EQ(film_container("plain words"), "");
}

TEST(ForeignFile, UnknownBytesHaveNoName) {
  EXPECT_FALSE(foreign_file(""));
  EXPECT_FALSE(foreign_file("\1\2\3\4\5\6"s));
}

}  // namespace
}  // namespace helicarm::xray
