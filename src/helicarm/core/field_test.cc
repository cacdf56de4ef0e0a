// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/field.h"

#include <array>
#include <limits>

#include <gtest/gtest.h>

namespace helicarm {
namespace {

enum class Colour { red, blue };

struct Inner {
  int size = 512;
};

struct Options {
  Colour colour = Colour::red;
  std::optional<double> limit_mm;
  Inner inner;
};

constexpr std::array<std::string_view, 2> colours{"red", "blue"};
constexpr std::array<Field<Options>, 3> fields{
    bound<&Options::colour>(
        {.name = "colour", .range = {0, 1}, .step = 1, .help = "Red or blue", .words = colours}),
    bound<&Options::limit_mm>({.name = "limit_mm", .unit = "mm", .range = {0.5, 10}, .help = "How far"}),
    bound<&Options::inner, &Inner::size>({.name = "size",
                                          .label = "Size of a side",
                                          .unit = "px",
                                          .range = {512, 1024},
                                          .step = 512,
                                          .help = "A side"})};

std::string complaint(const Field<Options>& field, std::optional<double> number) {
  const auto checked = check_number(field, number, "test");
  return checked ? "" : checked.error().message;
}

TEST(Field, ReadsAndWritesItsMember) {
  Options options;
  fields[0].set(options, 1);
  fields[1].set(options, 2.5);
  fields[2].set(options, 1024);
  EXPECT_EQ(options.colour, Colour::blue);
  EXPECT_EQ(options.limit_mm, 2.5);
  EXPECT_EQ(options.inner.size, 1024);
  for (const auto& field : fields) EXPECT_TRUE(field.get(options));
  fields[1].set(options, {});
  EXPECT_FALSE(fields[1].get(options));
  fields[2].set(options, {});  // a required field keeps its value
  EXPECT_EQ(options.inner.size, 1024);
}

TEST(Field, OnlyOptionalFieldsMayBeUnset) {
  EXPECT_TRUE(fields[1].optional);
  EXPECT_FALSE(fields[2].optional);
  EXPECT_EQ(complaint(fields[1], {}), "");
  EXPECT_EQ(complaint(fields[2], {}), "test: size: nothing is not 512 to 1024 px in steps of 512");
}

TEST(Field, MessageNamesFieldValueAndLimits) {
  EXPECT_EQ(complaint(fields[1], 10), "");
  EXPECT_EQ(complaint(fields[1], 10.5), "test: limit_mm: 10.5 is not 0.5 to 10 mm");
  EXPECT_EQ(complaint(fields[2], 700), "test: size: 700 is not 512 to 1024 px in steps of 512");
  EXPECT_EQ(complaint(fields[0], 0.5), "test: colour: 0.5 is not red or blue");
  EXPECT_NE(complaint(fields[1], std::numeric_limits<double>::quiet_NaN()), "");
}

TEST(Field, AllFieldsAreChecked) {
  Options options;
  EXPECT_TRUE(check_fields(fields, options, "options"));
  options.inner.size = 5;
  EXPECT_EQ(check_fields(fields, options, "options").error().reason, Reason::bad_value);
}

TEST(Field, IsFoundByItsName) {
  constexpr Range range = field_named<Options>(fields, "limit_mm").range;
  EXPECT_EQ(range.high, 10);
  EXPECT_THROW(field_named<Options>(fields, "weight"), std::out_of_range);
  EXPECT_EQ(label_of(fields[1]), "Limit");
  EXPECT_EQ(label_of(fields[2]), "Size of a side");
}

}  // namespace
}  // namespace helicarm
