// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/timeline.h"

#include <QCoreApplication>
#include <QStringList>
#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/operation/records.h"
#include "helicarm/operation/seen_poses.h"
#include "helicarm/operation/session_log.h"

namespace helicarm::gui {
namespace {

struct TimelineWords {
  Q_DECLARE_TR_FUNCTIONS(Timeline)
};

QString text_of(const Json& content, const char* key) {
  return QString::fromStdString(content.at(key).get<std::string>());
}

QString millimetres(const Json& number) { return QString::number(number.get<double>(), 'f', 2); }

QString count_of(const Json& list) { return QString::number(list.size()); }

QString exposure_summary(const Json& content) {
  const QString view = text_of(content, "view");
  return content.at("poses").is_null() ? TimelineWords::tr("Acquisition %1, without poses").arg(view)
                                       : TimelineWords::tr("Acquisition %1").arg(view);
}

QString loop_summary(const Json& content) {
  const Json& loop = content.at("loop");
  const QString tunnel = text_of(content, "tunnel");
  if (loop.empty()) return TimelineWords::tr("Tool at %1").arg(tunnel);
  return TimelineWords::tr("Tool at %1: error %2 mm, measurements: %3")
      .arg(tunnel, millimetres(loop.back().at("distance_mm")), count_of(loop));
}

QString outcome_summary(const Json& content) {
  return TimelineWords::tr("Check of %1: start %2 mm, end %3 mm from the tool's axis")
      .arg(text_of(content, "tunnel"), millimetres(content.at("start").at("distance_mm")),
           millimetres(content.at("end").at("distance_mm")));
}

QString poses_summary(const Json& content) {
  QStringList seen;
  for (const auto& [tool, samples] : content.at("window").at("tools").items())
    if (!samples.empty()) seen << QString::fromStdString(tool);
  return TimelineWords::tr("Tracker poses (%1): %2")
      .arg(text_of(content, "why"), seen.isEmpty() ? TimelineWords::tr("none visible") : seen.join(", "));
}

QString summary_of(const std::string& kind, const Json& content) {
  if (kind == "session")
    return TimelineWords::tr("Record begins, helicarm %1").arg(text_of(content, "version"));
  if (kind == "plan") return TimelineWords::tr("Plan, tunnels: %1").arg(count_of(content.at("tunnels")));
  if (kind == "exposure") return exposure_summary(content);
  if (kind == "refused")
    return TimelineWords::tr("Image for %1 refused: %2")
        .arg(text_of(content, "view"), text_of(content, "why"));
  if (kind == "case") return TimelineWords::tr("Measurement %1 begins").arg(text_of(content, "folder"));
  if (kind == "result") return TimelineWords::tr("Measurement %1 done").arg(text_of(content, "folder"));
  if (kind == "poses") return poses_summary(content);
  if (kind == "hand_eye")
    return TimelineWords::tr("Robot registered, %1 mm rms, poses: %2")
        .arg(millimetres(content.at("found").at("rms_mm")), count_of(content.at("pairs")));
  if (kind == "order")
    return TimelineWords::tr("Order %1, waypoints: %2")
        .arg(text_of(content, "name"), count_of(content.at("waypoints")));
  if (kind == "confirmed")
    return TimelineWords::tr("Order %1 confirmed by %2")
        .arg(text_of(content, "order"), text_of(content, "by"));
  if (kind == "halted")
    return TimelineWords::tr("Order %1 halted: %2")
        .arg(text_of(content, "order"), text_of(content, "message"));
  if (kind == "replanned")
    return TimelineWords::tr("Order %1 planned again after %2")
        .arg(text_of(content, "order"), text_of(content, "why"));
  if (kind == "navigated") return loop_summary(content);
  if (kind == "outcome") return outcome_summary(content);
  if (kind == "end") return TimelineWords::tr("End of the operation");
  return QString::fromStdString(kind);
}

/// Runs `read`; a record without the fields of its kind is bad_value.
template <class Read>
auto of_record(std::size_t number, Read&& read) {
  try {
    return read();
  } catch (const Json::exception&) {
    throw BadInput(Reason::bad_value,
                   fmt::format("record {}: a field that its kind requires is missing", number));
  }
}

void see(SessionState& state, const Json& window, std::size_t number) {
  const std::string origin = fmt::format("record {}", number);
  for (const auto& [tool, samples] : value_or_throw(operation::pose_window_from(window, origin)).samples)
    if (!samples.empty()) state.tracker_from[tool] = samples.back().tracker_from_tool;
}

std::vector<robot::Miss> loop_from(const Json& json) {
  std::vector<robot::Miss> loop;
  for (const Json& miss : json)
    loop.push_back({miss.at("distance_mm").get<double>(), miss.at("turn_deg").get<double>(),
                    miss.at("sigma_mm").get<double>()});
  return loop;
}

operation::EndMiss end_miss_from(const Json& json) {
  operation::EndMiss miss;
  for (int i = 0; i < 2; ++i) {
    miss.across_mm[i] = json.at("across_mm").at(std::size_t(i)).get<double>();
    for (int j = 0; j < 2; ++j)
      miss.covariance(i, j) = json.at("covariance_mm2").at(std::size_t(i)).at(std::size_t(j)).get<double>();
  }
  return miss;
}

void take(SessionState& state, const Timeline& timeline, std::size_t number) {
  const auto& [seconds, kind, summary, content] = timeline.moments[number];
  if (kind == "exposure") {
    const auto view = content.at("view").get<std::string>();
    std::erase(state.exposures, view);
    state.exposures.push_back(view);
    state.exposed_at[view] = number;
  }
  if (kind == "hand_eye") {
    state.registered_at = number;
    state.hand_eye_rms_mm = content.at("found").at("rms_mm").get<double>();
  }
  if (kind == "order") state.tunnel = content.at("name").get<std::string>();
  if (kind == "exposure" || kind == "poses") see(state, content.at("window"), number);
  if (kind == "case")
    state.case_folder =
        value_or_throw(path_inside(timeline.session, content.at("folder").get<std::string>()));
  if (kind == "case" || kind == "result") state.measured = kind == "result";
  if (kind == "navigated")
    state.loops[content.at("tunnel").get<std::string>()] = loop_from(content.at("loop"));
  if (kind == "outcome") {
    const auto tunnel = content.at("tunnel").get<std::string>();
    state.outcomes.insert_or_assign(tunnel, operation::TunnelOutcome{tunnel,
                                                                     state.loops[tunnel],
                                                                     end_miss_from(content.at("start")),
                                                                     end_miss_from(content.at("end")),
                                                                     {}});
  }
}

operation::OperationPlan plan_of(const Timeline& timeline) {
  const auto plan = std::ranges::find(timeline.moments, "plan", &Moment::kind);
  if (plan == timeline.moments.end()) throw BadInput(Reason::usage, "the record holds no plan");
  return value_or_throw(operation::plan_from(plan->content, "the record's plan"));
}

}  // namespace

QString Moment::detail() const { return QString::fromStdString(to_text(content)); }

std::size_t Timeline::at(double seconds) const {
  const auto later = std::ranges::upper_bound(moments, seconds, {}, &Moment::seconds);
  return std::size_t(std::max<std::ptrdiff_t>(later - moments.begin() - 1, 0));
}

Expected<Timeline> read_timeline(const std::filesystem::path& session) {
  return guarded([&] {
    operation::SessionHistory history = value_or_throw(operation::read_session(session / "session.log"));
    if (history.records.empty())
      throw BadInput(Reason::bad_value, fmt::format("{}: the record is empty", session.string()));
    Timeline timeline{session, {}, history.torn};
    double seconds = 0;
    const double begin = history.records.front().time_s;
    for (operation::SessionRecord& record : history.records) {
      seconds = std::max(seconds, record.time_s - begin);  // the clock may be set back
      QString summary = of_record(record.number, [&] { return summary_of(record.kind, record.content); });
      timeline.finished = timeline.finished || record.kind == "end";
      timeline.moments.push_back({seconds, record.kind, std::move(summary), std::move(record.content)});
    }
    return timeline;
  });
}

Expected<SessionState> state_at(const Timeline& timeline, std::size_t index) {
  return guarded([&] {
    SessionState state;
    for (std::size_t i = 0; i <= index && i < timeline.moments.size(); ++i)
      of_record(i, [&] { take(state, timeline, i); });
    return state;
  });
}

Expected<operation::LiveTool> tool_of(const Timeline& timeline, const SessionState& state,
                                      const pipeline::Result& result) {
  return guarded([&] {
    if (!state.measured || !state.registered_at)
      throw BadInput(Reason::usage, "no measurement or no registration before this moment");
    const operation::OperationPlan plan = plan_of(timeline);
    std::vector<guidance::Poses> exposures;
    for (const pipeline::ViewResult& view : result.views) {
      const auto at = state.exposed_at.find(view.name);
      if (at == state.exposed_at.end())
        throw BadInput(Reason::usage, fmt::format("{}: no image before this moment", view.name));
      const std::string origin = fmt::format("record {}", at->second);
      const Json& window = timeline.moments[at->second].content.at("window");
      exposures.push_back(value_or_throw(operation::poses_of_exposure(
          value_or_throw(operation::pose_window_from(window, origin)), plan.tracker)));
    }
    const Json& pairs = timeline.moments[*state.registered_at].content.at("pairs");
    const tracker::HandEye hand_eye = value_or_throw(tracker::calibrate_hand_eye(value_or_throw(
        operation::hand_eye_pairs_from(pairs, fmt::format("record {}", *state.registered_at)))));
    return operation::LiveTool(plan, result, exposures, hand_eye);
  });
}

Expected<operation::ToolOverlay> overlay_of(const operation::LiveTool& tool, const Timeline& timeline,
                                            const SessionState& state) {
  return guarded([&] {
    const operation::OperationPlan plan = plan_of(timeline);
    const auto pose = [&](const std::string& marker) -> std::optional<geometry::RigidTransform> {
      const auto seen = state.tracker_from.find(marker);
      return seen == state.tracker_from.end() ? std::nullopt : std::optional(seen->second);
    };
    if (plan.tunnels.empty()) throw BadInput(Reason::bad_value, "the plan has no tunnel");
    const auto tunnel = std::ranges::find(plan.tunnels, state.tunnel, &operation::PlannedTunnel::name);
    guidance::Poses now;
    for (const auto& [bone, marker] : plan.tracker.markers)
      if (const auto seen = pose(marker)) now.tracker_from_bone.emplace(bone, *seen);
    now.tracker_from_tool = pose(plan.tracker.tool);
    return value_or_throw(
        tool.overlay(now, tunnel == plan.tunnels.end() ? plan.tunnels.front().bone : tunnel->bone));
  });
}

}  // namespace helicarm::gui
