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

TEST(ReadCsv, MessagesOfColumnsListTheOthers) {
  EXPECT_NE(table_of("u_px,v\n1,2\n").error().message.find("\"v_px\" is missing (given: u_px, v)"),
            std::string::npos);
  EXPECT_NE(table_of("u_px,v_px,w\n1,2,3\n").error().message.find("(known: u_px, v_px, sigma_px)"),
            std::string::npos);
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

TEST(ReadCsv, QuotedFieldsMayHoldCommasAndQuotes) {
  const fs::path path = fs::temp_directory_path() / ("helicarm_csv_" + std::to_string(::getpid()) + ".csv");
  const std::string name = "femur, \"left\" #1";
  ASSERT_TRUE(write_file(path, "name,u_px\r\n" + csv_field(name) + ",1\r\n \"a\" , \"2\"\r\n\"\",3"));
  const auto table = read_csv(path, {"name", "u_px"}, {});
  fs::remove(path);
  ASSERT_TRUE(table) << table.error().message;
  ASSERT_EQ(table->rows(), 3u);
  EXPECT_EQ(table->text(0, "name"), name);
  EXPECT_EQ(table->text(1, "name"), "a");
  EXPECT_EQ(table->number(1, "u_px"), 2);
  EXPECT_EQ(table->text(2, "name"), "");
}

TEST(ReadCsv, BrokenQuotesAreRefused) {
  EXPECT_EQ(table_of("u_px,v_px\n\"1,2\n").error().reason, Reason::truncated);
  EXPECT_EQ(table_of("u_px,v_px\n\"1\"0,2\n").error().reason, Reason::bad_value);
  EXPECT_EQ(table_of("u_px,v_px\n\"1\n\",2\n").error().reason, Reason::bad_value);
}

TEST(ReadCsv, NumberMayHaveAPlus) {
  const auto table = table_of("u_px,v_px\n+0.94,+2e1\n+-1,+\n");
  ASSERT_TRUE(table);
  EXPECT_EQ(table->number(0, "u_px"), 0.94);
  EXPECT_EQ(table->number(0, "v_px"), 20);
  EXPECT_THROW(table->number(1, "u_px"), BadInput);
  EXPECT_THROW(table->number(1, "v_px"), BadInput);
}

TEST(ReadCsv, LineEndsOfAnySystemAreRead) {
  for (const char* text : {"u_px,v_px\n1,2\n", "u_px,v_px\r\n1,2", "u_px,v_px\r1,2\r"}) {
    const auto table = table_of(text);
    ASSERT_TRUE(table) << table.error().message;
    ASSERT_EQ(table->rows(), 1u);
    EXPECT_EQ(table->number(0, "v_px"), 2);
  }
}

TEST(ReadCsv, SpreadsheetsOfOtherCountriesAreNamed) {
  const auto message_of = [](const std::string& text) { return table_of(text).error().message; };
  EXPECT_NE(message_of("u_px;v_px\n1,5;2\n").find("semicolons"), std::string::npos);
  EXPECT_NE(message_of("u_px\tv_px\n1\t2\n").find("tabs"), std::string::npos);
  EXPECT_NE(message_of(std::string("u\0_\0p\0", 6)).find("UTF-16"), std::string::npos);
  EXPECT_NE(message_of("u_px,v_px\n\xE4,2\n").find("UTF-8"), std::string::npos);
  const auto table = table_of("u_px,v_px\n\"1,5\",2\n");
  ASSERT_TRUE(table);
  try {
    table->number(0, "u_px");
    FAIL();
  } catch (const BadInput& bad) {
    EXPECT_NE(bad.failure().message.find("with a point"), std::string::npos);
  }
}

}  // namespace
}  // namespace helicarm
