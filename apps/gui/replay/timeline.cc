// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/timeline.h"

#include <QCoreApplication>
#include <QStringList>
#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/operation/replay.h"

namespace helicarm::gui {
namespace {

struct TimelineWords {
  Q_DECLARE_TR_FUNCTIONS(Timeline)
};

using namespace operation;

QString text(const std::string& utf8) { return QString::fromStdString(utf8); }

QString millimetres(double number) { return QString::number(number, 'f', 2); }

/// One line for each kind of record.
struct Summary {
  QString operator()(const record::Session& session) const {
    return TimelineWords::tr("Record begins, helicarm %1").arg(text(session.version));
  }
  QString operator()(const record::Plan& record) const {
    return TimelineWords::tr("Plan, tunnels: %1").arg(record.plan.tunnels.size());
  }
  QString operator()(const record::Models& models) const {
    return TimelineWords::tr("Model files kept: %1").arg(models.files.size());
  }
  QString operator()(const record::Exposure& exposure) const {
    return (exposure.poses ? TimelineWords::tr("Acquisition %1")
                           : TimelineWords::tr("Acquisition %1, without poses"))
        .arg(text(exposure.view));
  }
  QString operator()(const record::Refused& refused) const {
    return TimelineWords::tr("Image for %1 refused: %2").arg(text(refused.view), text(refused.why));
  }
  QString operator()(const record::Touched& touched) const {
    return TimelineWords::tr("Check point %1 touched").arg(text(touched.check_point));
  }
  QString operator()(const record::CaseBegun& begun) const {
    return begun.verifies.empty() ? TimelineWords::tr("Measurement %1 begins").arg(text(begun.folder))
                                  : TimelineWords::tr("Verification of %1 begins: %2")
                                        .arg(text(begun.verifies), text(begun.folder));
  }
  QString operator()(const record::Measured& measured) const {
    return TimelineWords::tr("Measurement %1 done").arg(text(measured.folder));
  }
  QString operator()(const record::Registered& registered) const {
    return TimelineWords::tr("Models registered: %1").arg(text(registered.folder));
  }
  QString operator()(const record::RegistrationConfirmed& confirmed) const {
    return TimelineWords::tr("Registration confirmed by %1").arg(text(confirmed.by));
  }
  QString operator()(const record::Poses& poses) const {
    QStringList seen;
    for (const auto& [tool, samples] : poses.window.samples)
      if (!samples.empty()) seen << text(tool);
    const std::array words{TimelineWords::tr("plan"),     TimelineWords::tr("hand-eye"),
                           TimelineWords::tr("correct"),  TimelineWords::tr("verify"),
                           TimelineWords::tr("withdraw"), TimelineWords::tr("guide")};
    return TimelineWords::tr("Tracker poses (%1): %2")
        .arg(words[std::size_t(poses.why)],
             seen.isEmpty() ? TimelineWords::tr("none visible") : seen.join(", "));
  }
  QString operator()(const record::Tour&) const {
    return TimelineWords::tr("Registration of the robot begins");
  }
  QString operator()(const record::HandEye& hand_eye) const {
    return TimelineWords::tr("Robot registered, %1 mm rms, poses: %2")
        .arg(millimetres(hand_eye.found.rms_mm))
        .arg(hand_eye.pairs.size());
  }
  QString operator()(const record::Withdraw&) const { return TimelineWords::tr("The tool withdraws"); }
  QString operator()(const record::Robot&) const { return TimelineWords::tr("Joints of the robot"); }
  QString operator()(const record::Order& record) const {
    return TimelineWords::tr("Order %1, waypoints: %2")
        .arg(text(record.order.name))
        .arg(record.order.waypoints.size());
  }
  QString operator()(const record::Preview& preview) const {
    return TimelineWords::tr("Path of order %1 drawn").arg(text(preview.order));
  }
  QString operator()(const record::Confirmed& confirmed) const {
    return TimelineWords::tr("Order %1 confirmed by %2").arg(text(confirmed.order), text(confirmed.by));
  }
  QString operator()(const record::CarriedOut& carried_out) const {
    return TimelineWords::tr("Order %1 carried out").arg(text(carried_out.confirmed.order));
  }
  QString operator()(const record::Halted& halted) const {
    return TimelineWords::tr("Order %1 halted: %2").arg(text(halted.order), text(halted.message));
  }
  QString operator()(const record::Replanned& replanned) const {
    return TimelineWords::tr("Order %1 planned again after %2")
        .arg(text(replanned.order), text(replanned.why));
  }
  QString operator()(const record::Navigated& navigated) const {
    if (navigated.loop.empty()) return TimelineWords::tr("Tool at %1").arg(text(navigated.tunnel));
    return TimelineWords::tr("Tool at %1: error %2 mm, measurements: %3")
        .arg(text(navigated.tunnel), millimetres(navigated.loop.back().distance_mm))
        .arg(navigated.loop.size());
  }
  QString operator()(const record::Guide& guide) const {
    return TimelineWords::tr("Drill guided to %1").arg(text(guide.tunnel));
  }
  QString operator()(const record::Guided& guided) const {
    const Guidance& now = guided.guidance;
    const QString decision = now.why_not ? text(now.why_not->message) : TimelineWords::tr("on target");
    if (!now.aim) return TimelineWords::tr("Drill at %1: %2").arg(text(guided.tunnel), decision);
    return TimelineWords::tr("Drill at %1, %2 mm and %3° off its axis: %4")
        .arg(text(guided.tunnel), millimetres(now.aim->distance_mm),
             QString::number(now.aim->angle_deg, 'f', 1), decision);
  }
  QString operator()(const record::GuidanceEnded& ended) const {
    using enum record::GuidanceEndedBy;
    const QString by = [&] {
      switch (ended.by) {
        case verified:
          return TimelineWords::tr("verified");
        case person:
          return TimelineWords::tr("by the person");
        case plan_stale:
          return TimelineWords::tr("begun again after plan_stale");
        case new_guidance:
          return TimelineWords::tr("another guidance begins");
        case new_plan:
          return TimelineWords::tr("images, measurement or registration are others now");
        case operation:
          return TimelineWords::tr("end of the operation");
        case check_point:
          return TimelineWords::tr("a check point of its bone was refused");
      }
      return QString();
    }();
    return TimelineWords::tr("Guidance to %1 ended: %2").arg(text(ended.tunnel), by);
  }
  QString operator()(const record::Outcome& outcome) const {
    const QString check = TimelineWords::tr("Check of %1: start %2 mm, end %3 mm from the tool's axis")
                              .arg(text(outcome.tunnel), millimetres(outcome.start.distance_mm()),
                                   millimetres(outcome.end.distance_mm()));
    return outcome.depth ? TimelineWords::tr("%1; tip %2").arg(check, text(words_of(*outcome.depth))) : check;
  }
  QString operator()(const record::End& end) const {
    return end.why ? TimelineWords::tr("End of the operation: %1").arg(text(*end.why))
                   : TimelineWords::tr("End of the operation");
  }
};

const OperationPlan& recorded_plan(const Timeline& timeline) {
  for (const Moment& moment : timeline.moments)
    if (const auto* record = std::get_if<record::Plan>(&moment.record)) return record->plan;
  throw BadInput(Reason::usage, "the record holds no plan");
}

/// The state after a record, which holds what the record says.
struct Take {
  SessionState& state;
  const Timeline& timeline;
  std::size_t number;

  void see(const PoseWindow& window) const {
    for (const auto& [marker, samples] : window.samples)
      state.tracker_from[marker] =
          is_seen_at_end(window, marker) ? std::optional(samples.back().tracker_from_tool) : std::nullopt;
  }

  void end_guidance() const {
    state.is_guided = false;
    state.guidance.reset();
  }
  void forget_models() const {
    state.models.reset();
    state.is_confirmed = false;
  }
  void forget_outcome(const std::string& tunnel) const {
    state.outcomes.erase(tunnel);
    state.loops.erase(tunnel);
  }
  void forget_measurement() const {
    state.measured = false;
    state.outcomes.clear();
    state.loops.clear();
    end_guidance();
    forget_models();
  }

  template <class Other>
  void operator()(const Other&) const {}
  void operator()(const record::Exposure& exposure) const {
    see(exposure.window);
    std::erase(state.exposures, exposure.view);
    state.exposures.push_back(exposure.view);
    if (!is_accepted(exposure, recorded_plan(timeline))) return;
    state.exposed_at[exposure.view] = number;
    forget_measurement();
  }
  void operator()(const record::HandEye& hand_eye) const {
    state.registered_at = number;
    state.hand_eye_rms_mm = hand_eye.found.rms_mm;
  }
  void operator()(const record::Order& record) const { state.tunnel = record.order.name; }
  void operator()(const record::Poses& poses) const { see(poses.window); }
  void operator()(const record::Touched& touched) const { see(touched.window); }
  void operator()(const record::Guide& guide) const {
    state.tunnel = guide.tunnel;
    state.is_guided = true;
    state.guidance.reset();
    see(guide.window);
  }
  void operator()(const record::Guided& guided) const {
    state.tunnel = guided.tunnel;
    state.guidance = guided.guidance;
    see(guided.window);
  }
  void operator()(const record::GuidanceEnded&) const { end_guidance(); }
  void operator()(const record::Refused& refused) const {
    if (!refused.picture) forget_measurement();  // an earlier image was found to be delayed
  }
  void operator()(const record::Registered& registered) const {
    forget_models();
    state.models = registered;
    // That of the measurement, in which the folder lies: the newest may be of a verification.
    state.case_folder = value_or_throw(path_inside(timeline.session, registered.folder)).parent_path();
    for (const OperationTunnel& tunnel : recorded_plan(timeline).tunnels)
      if (tunnel.of_model) forget_outcome(tunnel.name);
  }
  void operator()(const record::RegistrationConfirmed&) const { state.is_confirmed = true; }
  void operator()(const record::CaseBegun& begun) const {
    if (begun.verifies.empty()) forget_measurement();
  }
  void operator()(const record::Measured& measured) const {
    if (state.models) return;  // of a verification, by the images and models of the measurement
    state.case_folder = value_or_throw(path_inside(timeline.session, measured.folder));
    state.measured = true;
  }
  void operator()(const record::Navigated& navigated) const {
    state.loops[navigated.tunnel] = navigated.loop;
  }
  void operator()(const record::Outcome& outcome) const {
    end_guidance();  // no record of earlier versions says so
    state.outcomes.insert_or_assign(
        outcome.tunnel, TunnelOutcome{outcome.tunnel, state.loops[outcome.tunnel], outcome.start, outcome.end,
                                      outcome.depth ? std::optional(guidance::Verification{
                                                          outcome.tunnel, {}, {}, outcome.depth})
                                                    : std::nullopt});
  }
};

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
    for (SessionRecord& written : history.records) {
      seconds = std::max(seconds, written.time_s - begin);  // the clock may be set back
      Record record = value_or_throw(record_from(written, session));
      timeline.finished = timeline.finished || std::holds_alternative<record::End>(record);
      QString summary = std::visit(Summary{}, record);
      timeline.moments.push_back(
          {seconds, written.kind, std::move(summary), std::move(written.content), std::move(record)});
    }
    return timeline;
  });
}

Expected<OperationPlan> plan_of(const Timeline& timeline) {
  return guarded([&] { return recorded_plan(timeline); });
}

Expected<SessionState> state_at(const Timeline& timeline, std::size_t index) {
  return guarded([&] {
    SessionState state;
    for (std::size_t i = 0; i <= index && i < timeline.moments.size(); ++i)
      std::visit(Take{state, timeline, i}, timeline.moments[i].record);
    return state;
  });
}

Expected<operation::LiveTool> tool_of(const Timeline& timeline, const SessionState& state,
                                      const pipeline::Result& result) {
  return guarded([&] {
    const OperationPlan& plan = recorded_plan(timeline);
    if (!state.measured || (!plan.drill && !state.registered_at))
      throw BadInput(Reason::usage, "no measurement or no registration before this moment");
    std::vector<guidance::Poses> exposures;
    for (const pipeline::ViewResult& view : result.views) {
      const auto at = state.exposed_at.find(view.name);
      if (at == state.exposed_at.end())
        throw BadInput(Reason::usage, fmt::format("{}: no image before this moment", view.name));
      const auto& exposure = std::get<record::Exposure>(timeline.moments[at->second].record);
      exposures.push_back(value_or_throw(poses_of_exposure(exposure.window, plan.tracker)));
    }
    if (plan.drill) return LiveTool(plan, result, exposures, tracked_tool(*plan.drill));
    const auto& registered = std::get<record::HandEye>(timeline.moments[*state.registered_at].record);
    return LiveTool(plan, result, exposures, value_or_throw(tracker::calibrate_hand_eye(registered.pairs)));
  });
}

Expected<operation::ToolOverlay> overlay_of(const operation::LiveTool& tool, const Timeline& timeline,
                                            const SessionState& state) {
  return guarded([&] {
    const OperationPlan& plan = recorded_plan(timeline);
    const auto pose = [&](const std::string& marker) -> std::optional<geometry::RigidTransform> {
      const auto seen = state.tracker_from.find(marker);
      return seen == state.tracker_from.end() ? std::nullopt : seen->second;
    };
    if (plan.tunnels.empty()) throw BadInput(Reason::bad_value, "the plan has no tunnel");
    const auto tunnel = std::ranges::find(plan.tunnels, state.tunnel, &operation::OperationTunnel::name);
    guidance::Poses now;
    for (const auto& [bone, marker] : plan.tracker.markers)
      if (const auto seen = pose(marker)) now.tracker_from_bone.emplace(bone, *seen);
    now.tracker_from_tool = pose(plan.tracker.tool);
    return value_or_throw(
        tool.overlay(now, tunnel == plan.tunnels.end() ? plan.tunnels.front().bone : tunnel->bone));
  });
}

}  // namespace helicarm::gui
