// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/json.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm {
namespace {

Reason reason_of(const std::string& text) {
  auto parsed = parse_json(text, "x.json");
  EXPECT_FALSE(parsed.has_value());
  return parsed ? Reason::usage : parsed.error().reason;
}

TEST(ParseJson, NanIsNotFinite) {
  EXPECT_EQ(reason_of(R"({"a": NaN})"), Reason::not_finite);
  EXPECT_EQ(reason_of(R"({"a": [1, -Infinity]})"), Reason::not_finite);
  EXPECT_EQ(reason_of(R"({"a": 1e999})"), Reason::not_finite);
}

TEST(ParseJson, MalformedTextIsBadJson) {
  EXPECT_EQ(reason_of(R"({"a": )"), Reason::bad_json);
  EXPECT_EQ(reason_of(""), Reason::bad_json);
  EXPECT_EQ(reason_of("\x89PNG"), Reason::bad_json);
}

TEST(ParseJson, DuplicateKeyIsBadJson) { EXPECT_EQ(reason_of(R"({"a": 1, "a": 2})"), Reason::bad_json); }

TEST(ParseJson, SameKeyInTwoObjectsIsAccepted) {
  EXPECT_TRUE(parse_json(R"([{"a": 1}, {"a": 2}])", "x").has_value());
}

TEST(ParseJson, DeepNestingIsRefused) {
  EXPECT_EQ(reason_of(std::string(100000, '[')), Reason::bad_json);
  const auto nested = [](std::size_t depth) { return std::string(depth, '[') + std::string(depth, ']'); };
  EXPECT_TRUE(parse_json(nested(64), "x").has_value());
  EXPECT_EQ(reason_of(nested(65)), Reason::bad_json);
}

TEST(ParseJson, TimeForAListOfObjectsIsLinear) {
  std::string list = "[{}";
  for (int i = 0; i < 2000000; ++i) list += ",{}";
  EXPECT_EQ(parse_json(list + "]", "x").value().size(), 2000001u);
}

TEST(ParseJson, ObjectOfTooManyKeysIsRefused) {
  const auto object = [](int keys) {
    std::string text = "{";
    for (int i = 0; i < keys; ++i) text += fmt::format("{}\"{}\": 0", i > 0 ? "," : "", i);
    return text + "}";
  };
  EXPECT_TRUE(parse_json(object(1000), "x").has_value());
  EXPECT_EQ(reason_of(object(1001)), Reason::bad_json);
}

template <class F>
Failure failure_of(const std::string& text, F&& read) {
  const Json json = *parse_json(text, "x.json");
  auto result = guarded([&] {
    JsonReader reader(json, "x.json");
    read(reader);
    reader.finish();
    return 0;
  });
  EXPECT_FALSE(result.has_value());
  return result ? Failure{Reason::usage, ""} : result.error();
}

TEST(JsonReader, ValueOutsideItsRangeNamesFieldValueAndLimit) {
  const Failure failure = failure_of(R"({"size": 400})", [](JsonReader& r) { r.number("size", {0.5, 30}); });
  EXPECT_EQ(failure.reason, Reason::bad_value);
  EXPECT_EQ(failure.message, "x.json: \"size\": 400 is outside 0.5 to 30");
}

TEST(JsonReader, MissingKeySaysWhatToWrite) {
  const Json empty = Json::object();
  const auto message = [&](auto read) {
    return guarded([&] {
             JsonReader reader(empty, "a.json");
             read(reader);
           })
        .error()
        .message;
  };
  EXPECT_EQ(message([](JsonReader& r) { r.text("plate"); }),
            "a.json: \"plate\": is missing: write \"plate\": \"...\"");
  EXPECT_EQ(message([](JsonReader& r) {
              r.number("pitch_mm", {1, 100});
            }),
            "a.json: \"pitch_mm\": is missing: write a number from 1 to 100");
  EXPECT_EQ(message([](JsonReader& r) {
              r.numbers("xyz_mm", 3, {0, 1});
            }),
            "a.json: \"xyz_mm\": is missing: write a list of 3 numbers");
  EXPECT_EQ(message([](JsonReader& r) {
              r.choice("kind", {"balls", "holes"});
            }),
            "a.json: \"kind\": is missing: write \"kind\": \"balls\" or \"holes\"");
  EXPECT_EQ(message([](JsonReader& r) { r.objects("views", true); }),
            "a.json: \"views\": is missing: write \"views\": [{...}, ...]");
}

TEST(JsonReader, AMisspeltKeyIsNamedBesideTheMissingOne) {
  const Json json = {{"u_pxx", 1}, {"imgae", "a.png"}, {"diameter_m", 2}, {"imagine", 3}};
  const auto message = [&](auto read) {
    JsonReader reader(json, "a.json");
    return guarded([&] { read(reader); }).error().message;
  };
  EXPECT_EQ(message([](JsonReader& r) { r.text("image"); }),
            "a.json: \"image\": is missing: write \"image\": \"...\" (there is \"imgae\": misspelt?)");
  EXPECT_THAT(message([](JsonReader& r) {
                r.number("diameter_mm", {1, 100});
              }),
              testing::HasSubstr("(there is \"diameter_m\": misspelt?)"));
  EXPECT_THAT(message([](JsonReader& r) { r.text("u_px"); }), testing::Not(testing::HasSubstr("misspelt")));
  EXPECT_THAT(message([](JsonReader& r) {
                r.number("diameter_m", {1, 100});
                r.number("diameter_mm", {1, 100});
              }),
              testing::Not(testing::HasSubstr("misspelt")));
}

TEST(JsonReader, UnreadKeyIsUnknown) {
  const Failure failure = failure_of(R"({"size": 4, "sise": 5})", [](JsonReader& r) {
    r.number("size", {0, 9});
  });
  EXPECT_EQ(failure.reason, Reason::unknown_key);
}

TEST(JsonReader, UnknownKeyIsShownEscaped) {
  EXPECT_EQ(failure_of(R"({"\u001b[31m": 5})", [](JsonReader&) {}).message,
            "x.json: \"\\u001b[31m\" is not a known key (known: )");
}

TEST(JsonReader, KnownKeysAreListedOnce) {
  const Failure failure = failure_of(R"({"kind": "b", "sise": 5})", [](JsonReader& r) {
    if (!r.raw("kind").is_null()) r.choice("kind", {"a", "b"});
  });
  EXPECT_EQ(failure.message, "x.json: \"sise\" is not a known key (known: kind)");
}

TEST(JsonReader, ControlCharacterInATextIsBadValue) {
  for (const char* text : {R"({"name": "a\u0000b"})", R"({"name": "a\nb"})", R"({"name": "\u001b[31m"})"})
    EXPECT_EQ(failure_of(text, [](JsonReader& r) { r.text("name"); }).reason, Reason::bad_value) << text;
}

TEST(JsonReader, MissingFieldIsBadValue) {
  EXPECT_EQ(failure_of("{}", [](JsonReader& r) { r.text("name"); }).reason, Reason::bad_value);
}

TEST(JsonReader, MatrixOfWrongShapeIsBadValue) {
  EXPECT_EQ(failure_of(R"({"m": [[1, 2], [3]]})",
                       [](JsonReader& r) {
                         r.matrix("m", 2, 2, {-9, 9});
                       })
                .reason,
            Reason::bad_value);
}

TEST(ToText, InvalidUtf8IsReplaced) {
  EXPECT_EQ(to_text(Json{{"file", "\xff.dcm"}}), "{\n  \"file\": \"\xEF\xBF\xBD.dcm\"\n}");
}

TEST(ParseJson, SyntaxErrorIsGivenByLineAndColumn) {
  const auto failure = parse_json("{\n  \"a\": 1,\n  \"b\" 2\n}", "case.json").error();
  EXPECT_EQ(failure.reason, Reason::bad_json);
  EXPECT_EQ(failure.message, "case.json: not valid JSON at line 3, column 7");
}

TEST(ParseJson, ACommaBehindTheLastEntryIsNamed) {
  const auto message = [](const char* text) { return parse_json(text, "case.json").error().message; };
  EXPECT_EQ(message("{\n  \"a\": [1, 2],\n}"),
            "case.json: not valid JSON at line 3, column 1: remove the comma before \"}\"");
  EXPECT_EQ(message("[1, ]"), "case.json: not valid JSON at line 1, column 5: remove the comma before \"]\"");
  EXPECT_EQ(message("[,]"), "case.json: not valid JSON at line 1, column 2");
}

TEST(ParseJson, OtherEncodingsAreNamed) {
  const auto latin_1 = parse_json("{\n  \"name\": \"M\xFCller\"}", "case.json").error();
  EXPECT_EQ(latin_1.reason, Reason::bad_json);
  EXPECT_NE(latin_1.message.find("not UTF-8 at line 2, column 13"), std::string::npos) << latin_1.message;
  const auto utf_16 = parse_json(std::string("\xFF\xFE{\0}\0", 6), "case.json").error();
  EXPECT_EQ(utf_16.reason, Reason::bad_json);
  EXPECT_NE(utf_16.message.find("UTF-16"), std::string::npos);
  EXPECT_TRUE(parse_json("\xEF\xBB\xBF{\"name\": \"M\xC3\xBCller\"}", "case.json"));
}

}  // namespace
}  // namespace helicarm
