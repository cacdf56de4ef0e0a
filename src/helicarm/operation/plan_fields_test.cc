// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/plan_fields.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "helicarm/case_registration/register_fields.h"
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

template <class Options, std::size_t count>
void expect_in_plan(const std::array<Field<Options>, count>& fields) {
  for (const Field<Options>& field : fields) {
    const auto of_plan = std::ranges::find(plan_fields, field.name, &Field<OperationPlan>::name);
    if (field.name == "threads") continue;  // of the computer, not of the plan
    ASSERT_NE(of_plan, plan_fields.end()) << field.name;
    EXPECT_EQ(of_plan->flag, field.flag) << field.name;
    EXPECT_EQ(of_plan->range.high, field.range.high) << field.name;
  }
}

TEST(Fields, APlanStatesEveryOptionOfAMeasurementByTheSameNameAndFlag) {
  expect_in_plan(pipeline::run_fields);
  expect_in_plan(case_registration::search_fields);
}

TEST(Fields, OptionsOfAPlanReachItsMeasurements) {
  OperationPlan plan;
  for (const Field<OperationPlan>& field : plan_fields) field.set(plan, field.range.high);
  const case_registration::RegisterOptions options = measuring_options(plan);
  for (const auto& field : pipeline::run_fields)
    EXPECT_TRUE(field.name == "threads" || field.get(options.run) == field.range.high) << field.name;
  for (const auto& field : case_registration::search_fields)
    EXPECT_EQ(field.get(options.search), field.range.high) << field.name;
}

}  // namespace plan_fields_test
}  // namespace helicarm::operation
