// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/operation/live_tool.h"
#include "helicarm/operation/session_records.h"

namespace helicarm::gui {

/// One record of an operation, for display.
struct Moment {
  double seconds;  ///< since the record began
  std::string kind;
  QString summary;  ///< one line
  Json content;
  operation::Record record;  ///< what `content` says

  QString detail() const;  ///< the content as indented JSON
};

struct Timeline {
  std::filesystem::path session;
  std::vector<Moment> moments;
  bool torn = false;      ///< an incomplete record follows: the program was killed while writing
  bool finished = false;  ///< the operation was ended

  double length_s() const { return moments.empty() ? 0 : moments.back().seconds; }
  /// The last moment that is not later; 0 if all are.
  std::size_t at(double seconds) const;
};

/// State of the operation after a moment.
struct SessionState {
  std::vector<std::string> exposures;  ///< views in order of acquisition
  /// The newest case with a result: images and case.json. A verification by registered models leaves theirs.
  std::optional<std::filesystem::path> case_folder;
  bool measured = false;  ///< by the newest images
  /// The newest pose of each marker; nothing where the tracker looked for it last and did not see it.
  std::map<std::string, std::optional<geometry::RigidTransform>> tracker_from;
  std::map<std::string, std::vector<robot::Miss>> loops;     ///< the closed loop, by tunnel
  std::map<std::string, operation::TunnelOutcome> outcomes;  ///< the check that follows it, by tunnel
  std::map<std::string, std::size_t> exposed_at;             ///< moment of each view's newest image taken
  std::optional<std::size_t> registered_at;                  ///< moment of the latest registration
  std::optional<double> hand_eye_rms_mm;                     ///< of it
  std::string tunnel;                                        ///< target of the newest order or guidance
  bool is_guided = false;                                    ///< a drill in the hand, to it
  std::optional<operation::Guidance> guidance;               ///< its newest decision
  std::optional<operation::record::Registered> models;       ///< the registration of the plan's models
  bool is_confirmed = false;                                 ///< by a person, that registration
};

/// Reads session.log in a session's folder. An incomplete end is left out and reported in `torn`; refuses as
/// `read_session` and `operation::record_from`.
Expected<Timeline> read_timeline(const std::filesystem::path& session);

/// Refuses (usage) a record without a plan.
Expected<operation::OperationPlan> plan_of(const Timeline& timeline);

/// State after the moment with this index and all before it. Refuses as `read_timeline`.
Expected<SessionState> state_at(const Timeline& timeline, std::size_t index);

/// Follows the robot's tool or the hand-held drill in that state's case, whose measurement is `result`.
/// Refuses (usage) a state before the measurement, or that of a robot before its registration.
Expected<operation::LiveTool> tool_of(const Timeline& timeline, const SessionState& state,
                                      const pipeline::Result& result);

/// The tool at the newest poses, relative to the bone of the state's tunnel. Refuses as `LiveTool::overlay`,
/// so (no_pose) where the tool or that bone was not seen.
Expected<operation::ToolOverlay> overlay_of(const operation::LiveTool& tool, const Timeline& timeline,
                                            const SessionState& state);

}  // namespace helicarm::gui
