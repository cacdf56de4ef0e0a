// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/output.h"

#include <limits>
#include <map>

#include <Eigen/Core>
#include <gtest/gtest.h>

namespace helicarm {
namespace {

struct Ball {
  std::string label;
  double diameter_mm = 0;
};

struct Sample {
  int n = 3;
  bool mirrored = true;
  double chi2 = 1.5;
  std::optional<double> limit_mm;
  std::optional<Ball> ball;
  std::vector<Ball> balls;
  std::map<std::string, double> figures;
  Eigen::Vector3d centre{1, 2, std::numeric_limits<double>::quiet_NaN()};
  Eigen::Matrix<double, 2, 3> rows{{1, 2, 3}, {4, 5, 6}};
};

constexpr std::array<std::string_view, 2> kinds{"free", "smooth"};

template <class Output>
void describe_ball(Output& output, const Ball& ball) {
  output.value("label", ball.label, "its name");
  output.value("diameter_mm", ball.diameter_mm, "of the steel");
}

template <class Output>
void describe(Output& output, const Sample& sample) {
  output.word(
      "kind", [&] { return kinds[1]; }, kinds, "of path");
  output.value("n", sample.n, "number");
  output.value("mirrored", sample.mirrored, "whether");
  output.value("chi2", sample.chi2, "of all");
  output.value("limit_mm", sample.limit_mm, "stated");
  output.value("label_of_ball", output::if_set(sample.ball, &Ball::label), "");
  output.value("figures", sample.figures, "by name");
  output.value("centre", sample.centre, "position");
  output.value(
      "rows", [&] { return sample.rows; }, "matrix");
  output.object_of("ball", sample.ball, "the one",
                   [](auto& row, const Ball& ball) { describe_ball(row, ball); });
  output.list("balls", sample.balls, "all", [](auto& row, const Ball& ball) { describe_ball(row, ball); });
  output.value_where(sample.n > 3, "more", sample.n, "of more than three");
  output.map(
      "by_name",
      [&] {
        std::vector<std::pair<std::string, Ball>> named;
        for (const Ball& ball : sample.balls) named.push_back({ball.label, ball});
        return named;
      },
      "likewise", [](auto& row, const Ball& ball) { describe_ball(row, ball); });
}

Json written(const Sample& sample) {
  return output_of([&](OutputJson& output) { describe(output, sample); });
}

TEST(Output, WhatIsNotKnownIsNull) {
  const Json json = written({});
  EXPECT_TRUE(json.at("limit_mm").is_null());
  EXPECT_TRUE(json.at("ball").is_null());
  EXPECT_TRUE(json.at("label_of_ball").is_null());
  EXPECT_EQ(json.at("balls"), Json::array());
  EXPECT_EQ(json.at("by_name"), Json::object());
  EXPECT_FALSE(json.contains("more"));
}

TEST(Output, ANumberThatIsNotFiniteIsNull) { EXPECT_EQ(written({}).at("centre"), Json({1.0, 2.0, nullptr})); }

TEST(Output, ValuesKeepTheirShape) {
  Sample sample;
  sample.n = 4;
  sample.ball = Ball{"P1", 3};
  sample.balls = {{"P1", 3}, {"P2", 2}};
  sample.figures = {{"gap_mm", 0.5}};
  const Json json = written(sample);
  EXPECT_EQ(json.at("kind"), "smooth");
  EXPECT_EQ(json.at("rows"), (Json{{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}}));
  EXPECT_EQ(json.at("figures"), (Json{{"gap_mm", 0.5}}));
  EXPECT_EQ(json.at("ball"), (Json{{"label", "P1"}, {"diameter_mm", 3.0}}));
  EXPECT_EQ(json.at("label_of_ball"), "P1");
  EXPECT_EQ(json.at("balls").size(), 2U);
  EXPECT_EQ(json.at("by_name").at("P2").at("diameter_mm"), 2.0);
  EXPECT_EQ(json.at("more"), 4);
}

TEST(Output, TheSchemaSaysWhatIsAlwaysThereAndWhatMayBeNull) {
  const Json schema = output_schema("sample.json", [](OutputSchema& output) { describe(output, Sample()); });
  const Json& keys = schema.at("properties");
  EXPECT_EQ(schema.at("required").size(), keys.size() - 1);  // all but "more"
  EXPECT_EQ(keys.at("n").at("type"), "integer");
  EXPECT_EQ(keys.at("chi2").at("type"), (Json{"number", "null"}));
  EXPECT_EQ(keys.at("kind").at("enum"), (Json{"free", "smooth"}));
  EXPECT_EQ(keys.at("ball").at("type"), (Json{"object", "null"}));
  EXPECT_EQ(keys.at("balls").at("items").at("properties").at("label").at("type"), "string");
  EXPECT_EQ(keys.at("rows").at("minItems"), 2);
  EXPECT_EQ(keys.at("rows").at("items").at("maxItems"), 3);
  EXPECT_EQ(keys.at("by_name").at("additionalProperties").at("properties").size(), 2U);
  EXPECT_EQ(keys.at("centre").at("description"), "position");
}

}  // namespace
}  // namespace helicarm
