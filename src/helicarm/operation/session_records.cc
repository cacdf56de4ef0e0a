// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/session_records.h"

#include <fmt/format.h>

#include "helicarm/operation/session_record_descriptions.h"

namespace helicarm::operation {
namespace record::description {

guidance::Poses recorded_poses(const Json& recorded, const std::string& where) {
  const Json json = pipeline::in_present_form(recorded);
  JsonReader reader(json, where);
  guidance::Poses poses;
  if (reader.has("tracker_from_calibrator"))
    poses.tracker_from_calibrator = recorded_pose(reader, "tracker_from_calibrator");
  if (reader.has("tracker_from_tool")) poses.tracker_from_tool = recorded_pose(reader, "tracker_from_tool");
  if (!reader.has("tracker_from_bone")) return poses;
  JsonReader bones = reader.object("tracker_from_bone");
  for (const auto& [bone, pose] : json.at("tracker_from_bone").items())
    poses.tracker_from_bone.emplace(bone, recorded_pose(bones, bone.c_str()));
  return poses;
}

std::string verified_by(const Json& case_json) {
  const auto lines = case_json.find("tool_lines");
  if (lines == case_json.end() || !lines->is_array() || lines->empty()) return {};
  return JsonReader(lines->at(0), "case.json: tool_lines").text("tunnel");
}

}  // namespace record::description

namespace {

using record::description::describe;
using record::description::Of;

template <class Kind>
Kind read(const Json& content, const std::string& origin) {
  JsonReader reader(content, origin);
  FromJson codec(reader);
  Kind value{};
  describe(codec, value, Of<Kind>{});
  reader.finish();
  return value;
}

template <class... Kinds>
std::optional<Record> read_one(const SessionRecord& record, const std::string& origin,
                               Of<std::variant<Kinds...>>) {
  std::optional<Record> found;
  const auto take = [&]<class Kind>(Of<Kind>) {
    if constexpr (!std::is_same_v<Kind, record::Plan> && !std::is_same_v<Kind, record::Order>)
      if (record.kind == Kind::kind) found = read<Kind>(record.content, origin);
  };
  (take(Of<Kinds>{}), ...);
  return found;
}

template <class... Kinds>
Json schema_of_kinds(Of<std::variant<Kinds...>>) {
  Json kinds = Json::object();
  const auto add = [&]<class Kind>(Of<Kind>) {
    ToSchema codec;
    if constexpr (!std::is_same_v<Kind, record::Plan> && !std::is_same_v<Kind, record::Order>) {
      Kind value{};
      describe(codec, value, Of<Kind>{});
    } else {
      codec.json = {{"type", "object"}};  // described elsewhere
    }
    kinds[Kind::kind] = std::move(codec.json);
    kinds[Kind::kind]["description"] = Kind::help;
  };
  (add(Of<Kinds>{}), ...);
  return kinds;
}

}  // namespace

std::string_view record::word_of(GuidanceEndedBy by) {
  return description::guidance_end_words[std::size_t(by)];
}

std::string_view kind_of(const Record& record) {
  return std::visit([](const auto& one) { return std::string_view(one.kind); }, record);
}

Json content_of(const Record& record) {
  return std::visit(
      []<class Kind>(const Kind& one) {
        if constexpr (std::is_same_v<Kind, record::Plan>) {
          return to_json(one.plan);
        } else if constexpr (std::is_same_v<Kind, record::Order>) {
          return one.text;
        } else {
          ToJson codec;
          describe(codec, one, Of<Kind>{});
          return std::move(codec.json);
        }
      },
      record);
}

Expected<Record> record_from(const SessionRecord& record, const std::filesystem::path& session) {
  return guarded([&]() -> Record {
    const std::string origin = fmt::format("record {}", record.number);
    if (record.kind == record::Plan::kind)
      return record::Plan{value_or_throw(plan_from(record.content, origin, session))};
    if (record.kind == record::Order::kind)
      return record::Order{record.content, value_or_throw(robot::robot_order_from(record.content, origin))};
    if (auto read = read_one(record, origin, Of<Record>{})) return *std::move(read);
    throw BadInput(Reason::unsupported, fmt::format("{}: \"{}\" is no kind of record", origin, record.kind));
  });
}

Json session_schema() {
  return {{"$schema", "https://json-schema.org/draft/2020-12/schema"},
          {"title", "session.log: the content of a record, by its kind"},
          {"type", "object"},
          {"properties", schema_of_kinds(Of<Record>{})}};
}

}  // namespace helicarm::operation
