// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/csv.h"

#include <locale>

#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"

namespace helicarm {
namespace {
namespace fs = std::filesystem;

Expected<CsvTable> table_of(const std::string& text) {
  const fs::path path = fs::temp_directory_path() / ("helicarm_csv_" + std::to_string(::getpid()) + ".csv");
  EXPECT_TRUE(write_file(path, text));
  auto table = read_csv(path, {"u_px", "v_px"}, {"sigma_px"});
  fs::remove(path);
  return table;
}

TEST(ReadCsv, ColumnsMayBeInAnyOrder) {
  const auto table = table_of("v_px, u_px\r\n2.5,1\n\n3,-4e2\n");
  ASSERT_TRUE(table.has_value());
  EXPECT_EQ(table->rows(), 2u);
  EXPECT_EQ(table->number(0, "v_px"), 2.5);
  EXPECT_EQ(table->number(1, "u_px"), -400);
  EXPECT_FALSE(table->optional_number(0, "sigma_px").has_value());
}

TEST(ReadCsv, ByteOrderMarkIsSkipped) {
  const auto table = table_of("\xEF\xBB\xBFu_px,v_px\n1,2\n");
  ASSERT_TRUE(table.has_value());
  EXPECT_EQ(table->number(0, "u_px"), 1);
}

TEST(ReadCsv, MissingAndUnknownColumnsAreNamed) {
  EXPECT_EQ(table_of("u_px\n1\n").error().reason, Reason::bad_value);
  EXPECT_EQ(table_of("u_px,v_px,w\n1,2,3\n").error().reason, Reason::unknown_key);
}

TEST(ReadCsv, RowOfDifferentLengthIsRefused) { EXPECT_FALSE(table_of("u_px,v_px\n1,2,3\n").has_value()); }

TEST(ReadCsv, ControlCharactersAreRefused) {
  for (const char* text : {"u_px,v_px\n1,\x1b[31m2\n", "u_px,v_px\n1,2\t3\n", "u_px,v\x7f\n1,2\n"}) {
    const auto table = table_of(text);
    ASSERT_FALSE(table.has_value()) << text;
    EXPECT_EQ(table.error().reason, Reason::bad_value);
    EXPECT_EQ(table.error().message.find('\x1b'), std::string::npos);
  }
}

TEST(ReadCsv, DecimalPointIsIndependentOfTheLocale) {
  struct Comma : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
  };
  const std::locale before = std::locale::global(std::locale(std::locale(), new Comma));
  const auto table = table_of("u_px,v_px\n1.5,2\n");
  std::locale::global(before);
  ASSERT_TRUE(table.has_value());
  EXPECT_EQ(table->number(0, "u_px"), 1.5);
}

TEST(ReadCsv, FieldsThatAreNotFiniteNumbersAreRefused) {
  const auto table = table_of("u_px,v_px\nnan,1e999\nx,\n");
  EXPECT_THROW(table->number(0, "u_px"), BadInput);
  EXPECT_THROW(table->number(0, "v_px"), BadInput);
  EXPECT_THROW(table->number(1, "u_px"), BadInput);
  EXPECT_THROW(table->number(1, "v_px"), BadInput);
}

}  // namespace
}  // namespace helicarm
