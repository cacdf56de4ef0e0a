// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/replay.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/operation/case_of.h"
#include "helicarm/operation/freehand.h"
#include "helicarm/operation/records.h"
#include "helicarm/session/session_log.h"
#include "helicarm/xray/digest.h"

namespace helicarm::operation {
namespace {

constexpr std::uintmax_t most_image_bytes = std::uintmax_t{256} << 20;

/// Names of the first differing fields, for a message.
std::string where(const Json& then, const Json& now) {
  constexpr std::size_t most = 4;
  const Json patch = Json::diff(then, now);
  std::string fields;
  for (std::size_t i = 0; i < std::min(most, patch.size()); ++i)
    fields += (i == 0 ? ": " : ", ") + patch[i].at("path").get<std::string>();
  if (patch.size() > most) fields += fmt::format(" and {} more", patch.size() - most);
  return fields;
}

Json without_timing(Json result) {
  result.erase("timing_ms");
  return result;
}

class Replay {
 public:
  explicit Replay(std::filesystem::path session) : session_(std::move(session)) {}

  void take(const session::SessionRecord& record) {
    const std::string origin = fmt::format("record {}", record.number);
    if (record.kind == "plan") plan_ = value_or_throw(plan_from(record.content, origin));
    if (record.kind == "exposure") exposure(record, origin);
    if (record.kind == "touched") touched(record, origin);
    if (record.kind == "case") images(record, origin);
    if (record.kind == "end") report.finished = true;
    if (record.kind == "result") result(record, origin);
    if (record.kind == "hand_eye") hand_eye(record, origin);
    if (record.kind == "guide") guide(record, origin);
    if (record.kind == "guided") guided(record, origin);
  }

  ReplayReport report;

 private:
  void differ(const std::string& origin, const std::string& how) {
    report.differences.push_back(origin + ": " + how);
  }
  void compare(const Json& then, const Json& now, const std::string& origin, const char* what) {
    if (then != now)
      differ(origin, fmt::format("the {} differs from the recorded value on recomputation{}", what,
                                 where(then, now)));
  }

  void exposure(const session::SessionRecord& record, const std::string& origin) {
    ++report.exposures;
    image_digests_[record.content.at("view").get<std::string>()] = record.content.at("picture");
    const PoseWindow window = value_or_throw(pose_window_from(record.content.at("window"), origin));
    const auto poses = poses_of_exposure(window, plan_.tracker);
    compare(record.content.at("poses"), poses ? to_json(*poses) : Json(), origin, "pose");
  }

  void touched(const session::SessionRecord& record, const std::string& origin) {
    const PoseWindow window = value_or_throw(pose_window_from(record.content.at("window"), origin));
    const auto check = std::ranges::find(
        plan_.check_points, record.content.at("check_point").get<std::string>(), &PlannedCheck::name);
    if (check == plan_.check_points.end()) return differ(origin, "its check point is not in the plan");
    const auto tip = touched_in_bone(window, plan_.tracker, check->bone);
    compare(record.content.at("in_bone"), tip ? geometry::json_list(*tip) : Json(), origin, "touched point");
  }

  /// The case must equal the recorded one, and its images those received.
  void images(const session::SessionRecord& record, const std::string& origin) {
    const std::string folder = record.content.at("folder").get<std::string>();
    if (record.content.contains("case")) {
      const std::string name = folder + "/case.json";
      const auto now = read_json(value_or_throw(path_inside(session_, name)));
      if (!now)
        differ(origin, now.error().message);
      else if (*now != record.content.at("case"))
        differ(origin, fmt::format("{} was changed{}", name, where(record.content.at("case"), *now)));
    }
    for (const auto& [view, recorded] : image_digests_) {
      ++report.images;
      const std::string name = fmt::format("{}/{}.dcm", folder, view);
      const auto file = read_file(value_or_throw(path_inside(session_, name)), most_image_bytes);
      if (!file)
        differ(origin, file.error().message);
      else if (xray::digest(*file) != recorded)
        differ(origin, name + " is not the recorded image");
    }
  }

  void result(const session::SessionRecord& record, const std::string& origin) {
    ++report.results;
    const std::string folder = record.content.at("folder").get<std::string>();
    const std::filesystem::path inside = value_or_throw(path_inside(session_, folder));
    const auto run = recompute_case(inside, plan_, cache_);
    if (!run) return differ(origin, run.error().message);
    result_ = run->result;
    if (record.content.at("digest") == run->digest) return;
    const auto then = read_json(inside / "result.json");
    differ(origin,
           fmt::format(
               "{}: the result differs from the recorded one on recomputation{}", folder,
               then ? where(without_timing(*then), without_timing(pipeline::to_json(run->result))) : ""));
  }

  void hand_eye(const session::SessionRecord& record, const std::string& origin) {
    ++report.hand_eyes;
    const auto pairs = value_or_throw(hand_eye_pairs_from(record.content.at("pairs"), origin));
    const auto found = tracker::calibrate_hand_eye(pairs);
    compare(record.content.at("found"), found ? to_json(*found) : Json(), origin, "hand-eye calibration");
  }

  void guide(const session::SessionRecord& record, const std::string& origin) {
    guide_.reset();
    const PoseWindow window = value_or_throw(pose_window_from(record.content.at("window"), origin));
    if (!plan_.drill || !result_) return differ(origin, "guidance without a drill or a measurement");
    const auto begun = guarded([&] {
      return value_or_throw(FreehandGuide::begin(
          plan_, LiveTool(plan_, *result_, {}, tracked_tool(*plan_.drill)),
          record.content.at("tunnel").get<std::string>(), value_or_throw(poses_now(window, plan_.tracker)),
          record.content.at("oldest_pose_s").get<double>()));
    });
    if (begun) guide_ = *begun;  // the operation refused it as well and recorded no decision
  }

  void guided(const session::SessionRecord& record, const std::string& origin) {
    ++report.decisions;
    if (!guide_) return differ(origin, "a decision before guidance began");
    const PoseWindow window = value_or_throw(pose_window_from(record.content.at("window"), origin));
    compare(record.content.at("guidance"), to_json(guide_->at(window)), origin, "decision");
  }

  std::filesystem::path session_;
  OperationPlan plan_;
  std::optional<pipeline::Result> result_;
  std::optional<FreehandGuide> guide_;
  pipeline::CalibrationCache cache_;
  std::map<std::string, std::string> image_digests_;
};

}  // namespace

Expected<ReplayReport> replay(const std::filesystem::path& session, const GoOn& go_on) {
  return guarded([&] {
    const session::SessionHistory history = value_or_throw(session::read_session(session / "session.log"));
    if (history.records.empty())
      throw BadInput(Reason::bad_value, fmt::format("{}: the record is empty", session.string()));
    Replay replay(session);
    replay.report.records = history.records.size();
    replay.report.torn = history.torn;
    for (const session::SessionRecord& record : history.records) try {
        if (!go_on(record.number, history.records.size()))
          throw BadInput(Reason::interrupted,
                         fmt::format("{}: stopped at record {}", session.string(), record.number));
        replay.take(record);
      } catch (const Json::exception&) {
        throw BadInput(Reason::bad_value,
                       fmt::format("record {}: a field that its kind requires is missing", record.number));
      }
    return replay.report;
  });
}

}  // namespace helicarm::operation
