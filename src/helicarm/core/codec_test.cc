// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/codec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm {
namespace {

enum class Paint { red, blue };
constexpr std::array<std::string_view, 2> paints{"red", "blue"};

/// As Eigen's vectors.
struct Pair {
  static constexpr int SizeAtCompileTime = 2;

  Pair() = default;
  explicit Pair(const double* from) : values{from[0], from[1]} {}
  auto begin() const { return values.begin(); }
  auto end() const { return values.end(); }

  std::array<double, 2> values{};
};

struct Ball {
  std::string name;
  Pair at;
};

struct Box {
  std::string name;
  std::optional<double> size_mm;
  std::optional<bool> open;
  Paint colour = Paint::blue;
  double weight = 3;
  std::optional<Ball> centre;
  std::vector<Ball> balls;
};

template <class Codec, class BallValue>
void describe_ball(Codec& codec, BallValue& ball) {
  codec.text("name", ball.name, "of the ball");
  codec.vector("at", ball.at, {-10, 10}, "place");
}

template <class Codec, class BoxValue>
void describe_box(Codec& codec, BoxValue& box) {
  const auto ball = [](auto& inner, auto& value) { describe_ball(inner, value); };
  codec.text("name", box.name, "of the box");
  codec.number("size_mm", box.size_mm, {1, 5}, "edge");
  codec.boolean("open", box.open, "at the top");
  codec.choice("colour", box.colour, paints, "outside");
  codec.number_or_default("weight", box.weight, {0, 100}, "kg");
  codec.object("centre", box.centre, "a ball", ball);
  codec.list("balls", box.balls, false, 2, "others", ball);
}

Expected<Box> box_from(const char* text) {
  return parse_json(text, "box.json").and_then([](const Json& json) {
    return guarded([&] {
      JsonReader reader(json, "box.json");
      FromJson codec(reader);
      Box box;
      describe_box(codec, box);
      reader.finish();
      return box;
    });
  });
}

TEST(Codec, WhatIsWrittenReadsBack) {
  const auto box = box_from(R"({"name": "a", "size_mm": 2, "open": false, "colour": "red", "weight": 4,
                                "centre": {"name": "c", "at": [1, 2]}, "balls": [{"name": "b", "at": [3, 4]}]})");
  ASSERT_TRUE(box) << box.error().message;
  ToJson written;
  describe_box(written, *box);
  const auto again = box_from(written.json.dump().c_str());
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->size_mm, 2);
  EXPECT_EQ(again->open, false);
  EXPECT_EQ(again->colour, Paint::red);
  EXPECT_EQ(again->weight, 4);
  EXPECT_THAT(again->centre->at.values, testing::ElementsAre(1, 2));
  EXPECT_EQ(again->balls.at(0).name, "b");
}

TEST(Codec, AbsentKeysKeepTheirDefaultsAndAreNotWritten) {
  const auto box = box_from(R"({"name": "a"})");
  ASSERT_TRUE(box) << box.error().message;
  EXPECT_FALSE(box->size_mm || box->open || box->centre);
  EXPECT_EQ(box->colour, Paint::blue);
  EXPECT_EQ(box->weight, 3);
  ToJson written;
  describe_box(written, *box);
  EXPECT_EQ(written.json.dump(), R"({"name":"a","colour":"blue","weight":3.0,"balls":[]})");
}

TEST(Codec, ValuesOutsideTheDescriptionAreRefusedByName) {
  for (const auto& [text, named] : {std::pair{R"({"name": ""})", "name"},
                                    {R"({"name": "a", "size_mm": 6})", "size_mm"},
                                    {R"({"name": "a", "colour": "green"})", "colour"},
                                    {R"({"name": "a", "centre": {"name": "b", "at": [1, 11]}})", "at"},
                                    {R"({"name": "a", "balls": [{"name": "b", "at": [1]}]})", "at"}}) {
    const auto box = box_from(text);
    ASSERT_FALSE(box) << text;
    EXPECT_EQ(box.error().reason, Reason::bad_value) << text;
    EXPECT_THAT(box.error().message, testing::HasSubstr(named)) << text;
  }
  EXPECT_EQ(box_from(R"({"name": "a", "centre": {"name": "b", "at": [1, 1], "x": 1}})").error().reason,
            Reason::unknown_key);
}

TEST(Codec, SchemaStatesWhatIsRequiredAndItsRange) {
  ToSchema schema;
  Box shape;
  describe_box(schema, shape);
  EXPECT_EQ(schema.json["required"], Json::array({"name"}));
  const Json& keys = schema.json["properties"];
  EXPECT_EQ(keys["size_mm"]["maximum"], 5);
  EXPECT_EQ(keys["size_mm"]["type"], Json::array({"number", "null"}));
  EXPECT_EQ(keys["colour"]["default"], "blue");
  EXPECT_EQ(keys["balls"]["items"]["required"], Json::array({"name", "at"}));
  EXPECT_EQ(keys["centre"]["properties"]["at"]["minItems"], 2);
}

}  // namespace
}  // namespace helicarm
