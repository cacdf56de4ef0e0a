// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/replay.h"

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/operation/case_of.h"
#include "helicarm/operation/records.h"
#include "helicarm/session/session_log.h"

namespace helicarm {
namespace {

class Replay {
 public:
  explicit Replay(std::filesystem::path session) : session_(std::move(session)) {}

  void take(const SessionRecord& record) {
    const std::string origin = fmt::format("record {}", record.number);
    if (record.kind == "plan") plan_ = value_or_throw(plan_from(record.content, origin));
    if (record.kind == "exposure") exposure(record, origin);
    if (record.kind == "result") result(record, origin);
    if (record.kind == "hand_eye") hand_eye(record, origin);
  }

  ReplayReport report;

 private:
  void compare(const Json& then, const Json& now, const std::string& origin, const char* what) {
    if (then != now)
      report.differences.push_back(fmt::format("{}: the {} comes out otherwise", origin, what));
  }

  void exposure(const SessionRecord& record, const std::string& origin) {
    ++report.exposures;
    const PoseWindow window = value_or_throw(pose_window_from(record.content.at("window"), origin));
    const auto poses = poses_of_exposure(window, plan_.tracker);
    compare(record.content.at("poses"), poses ? to_json(*poses) : Json(), origin, "pose");
  }

  void result(const SessionRecord& record, const std::string& origin) {
    ++report.results;
    const std::string folder = record.content.at("folder").get<std::string>();
    const auto run = recompute_case(value_or_throw(path_inside(session_, folder)), plan_);
    compare(record.content.at("digest"), run ? Json(run->digest) : Json(), origin, "result");
  }

  void hand_eye(const SessionRecord& record, const std::string& origin) {
    ++report.hand_eyes;
    const auto pairs = value_or_throw(hand_eye_pairs_from(record.content.at("pairs"), origin));
    const auto found = calibrate_hand_eye(pairs);
    compare(record.content.at("found"), found ? to_json(*found) : Json(), origin, "hand-eye calibration");
  }

  std::filesystem::path session_;
  OperationPlan plan_;
};

}  // namespace

Expected<ReplayReport> replay(const std::filesystem::path& session) {
  return guarded([&] {
    const SessionHistory history = value_or_throw(read_session(session / "session.log"));
    Replay replay(session);
    replay.report.records = history.records.size();
    replay.report.torn = history.torn;
    for (const SessionRecord& record : history.records) try {
        replay.take(record);
      } catch (const Json::exception&) {
        throw BadInput(Reason::bad_value, fmt::format("record {}: lacks what its kind needs", record.number));
      }
    return replay.report;
  });
}

}  // namespace helicarm
