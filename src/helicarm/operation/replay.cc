// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/replay.h"

#include <map>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/operation/case_of.h"
#include "helicarm/operation/records.h"
#include "helicarm/session/session_log.h"
#include "helicarm/xray/digest.h"

namespace helicarm {
namespace {

constexpr std::uintmax_t most_picture_bytes = std::uintmax_t{256} << 20;

class Replay {
 public:
  explicit Replay(std::filesystem::path session) : session_(std::move(session)) {}

  void take(const SessionRecord& record) {
    const std::string origin = fmt::format("record {}", record.number);
    if (record.kind == "plan") plan_ = value_or_throw(plan_from(record.content, origin));
    if (record.kind == "exposure") exposure(record, origin);
    if (record.kind == "case") pictures(record, origin);
    if (record.kind == "end") report.finished = true;
    if (record.kind == "result") result(record, origin);
    if (record.kind == "hand_eye") hand_eye(record, origin);
  }

  ReplayReport report;

 private:
  void differ(const std::string& origin, const std::string& how) {
    report.differences.push_back(origin + ": " + how);
  }
  void compare(const Json& then, const Json& now, const std::string& origin, const char* what) {
    if (then != now) differ(origin, fmt::format("the {} comes out otherwise", what));
  }

  void exposure(const SessionRecord& record, const std::string& origin) {
    ++report.exposures;
    picture_digests_[record.content.at("view").get<std::string>()] = record.content.at("picture");
    const PoseWindow window = value_or_throw(pose_window_from(record.content.at("window"), origin));
    const auto poses = poses_of_exposure(window, plan_.tracker);
    compare(record.content.at("poses"), poses ? to_json(*poses) : Json(), origin, "pose");
  }

  /// The case's pictures must be those that came.
  void pictures(const SessionRecord& record, const std::string& origin) {
    const std::string folder = record.content.at("folder").get<std::string>();
    for (const auto& [view, recorded] : picture_digests_) {
      ++report.pictures;
      const std::string name = folder + "/" + view + ".dcm";
      const auto file = read_file(value_or_throw(path_inside(session_, name)), most_picture_bytes);
      if (!file)
        differ(origin, file.error().message);
      else if (digest(*file) != recorded)
        differ(origin, name + " is not the picture that came");
    }
  }

  void result(const SessionRecord& record, const std::string& origin) {
    ++report.results;
    const std::string folder = record.content.at("folder").get<std::string>();
    const auto run = recompute_case(value_or_throw(path_inside(session_, folder)), plan_);
    if (!run)
      differ(origin, run.error().message);
    else
      compare(record.content.at("digest"), run->digest, origin + ": " + folder, "result");
  }

  void hand_eye(const SessionRecord& record, const std::string& origin) {
    ++report.hand_eyes;
    const auto pairs = value_or_throw(hand_eye_pairs_from(record.content.at("pairs"), origin));
    const auto found = calibrate_hand_eye(pairs);
    compare(record.content.at("found"), found ? to_json(*found) : Json(), origin, "hand-eye calibration");
  }

  std::filesystem::path session_;
  OperationPlan plan_;
  std::map<std::string, std::string> picture_digests_;
};

}  // namespace

Expected<ReplayReport> replay(const std::filesystem::path& session, const GoOn& go_on) {
  return guarded([&] {
    const SessionHistory history = value_or_throw(read_session(session / "session.log"));
    if (history.records.empty())
      throw BadInput(Reason::bad_value, fmt::format("{}: the record is empty", session.string()));
    Replay replay(session);
    replay.report.records = history.records.size();
    replay.report.torn = history.torn;
    for (const SessionRecord& record : history.records) try {
        if (!go_on(record.number, history.records.size()))
          throw BadInput(Reason::interrupted,
                         fmt::format("{}: stopped at record {}", session.string(), record.number));
        replay.take(record);
      } catch (const Json::exception&) {
        throw BadInput(Reason::bad_value, fmt::format("record {}: lacks what its kind needs", record.number));
      }
    return replay.report;
  });
}

}  // namespace helicarm
