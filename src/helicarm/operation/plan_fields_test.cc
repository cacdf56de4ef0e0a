// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/plan_fields.h"

#include <gtest/gtest.h>

#include "helicarm/devices/receiver/receiver_fields.h"
#include "helicarm/pipeline/run_fields.h"

namespace helicarm::operation {
namespace plan_fields_test {

template <class Options, std::size_t count>
void expect_sound(const std::array<Field<Options>, count>& fields) {
  const auto defaults = check_fields<Options>(fields, Options{}, "defaults");
  EXPECT_TRUE(defaults) << defaults.error().message;
  for (const Field<Options>& field : fields) {
    EXPECT_FALSE(field.help.empty()) << field.name;
    EXPECT_LT(field.range.low, field.range.high) << field.name;
    for (const double number : {field.range.low, field.range.high}) {
      Options options;
      field.set(options, number);
      EXPECT_EQ(field.get(options), number) << field.name;
      EXPECT_TRUE(check_number(field, number, "")) << field.name;
    }
    EXPECT_FALSE(check_number(field, 2 * field.range.high + 1, "")) << field.name;
  }
}

TEST(Fields, DefaultsLieWithinTheLimits) {
  expect_sound(plan_fields);
  expect_sound(pipeline::run_fields);
  expect_sound(receiver::receiver_fields);
}

}  // namespace plan_fields_test
}  // namespace helicarm::operation
