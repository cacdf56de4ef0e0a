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

namespace helicarm::gui {

/// One record of an operation, for a person to look at.
struct Moment {
  double seconds;  ///< since the record began
  std::string kind;
  QString summary;  ///< one line
  Json content;

  QString detail() const;  ///< the content as indented JSON
};

struct Timeline {
  std::filesystem::path session;
  std::vector<Moment> moments;
  bool torn = false;      ///< the program was killed while it wrote the next record
  bool finished = false;  ///< the operation came to its end

  double length_s() const { return moments.empty() ? 0 : moments.back().seconds; }
  /// The last moment that is not later; 0 where all are.
  std::size_t at(double seconds) const;
};

/// How far a tool was off its place when the tracker looked.
struct LoopMiss {
  double distance_mm;
  double turn_deg;
};

/// What was known once a moment had passed.
struct SessionState {
  std::vector<std::string> exposures;                   ///< views whose image was taken, in that order
  std::optional<std::filesystem::path> case_folder;     ///< the newest case: images and case.json
  bool measured = false;                                ///< that case has its result
  std::map<std::string, RigidTransform> tracker_from;   ///< the newest pose of each tool
  std::map<std::string, std::vector<LoopMiss>> misses;  ///< of the closed loop, by tunnel
  std::map<std::string, std::size_t> exposed_at;        ///< the moment of each view's image
  std::optional<std::size_t> registered_at;             ///< the moment of the robot's newest registration
  std::string tunnel;                                   ///< to which the newest order goes
};

/// Reads session.log in a session's folder. A torn end is left out and told; refuses as `read_session`, and
/// a record that lacks what its kind needs (bad_value).
Expected<Timeline> read_timeline(const std::filesystem::path& session);

/// After the moment with this index and all before it. Refuses as `read_timeline`.
Expected<SessionState> state_at(const Timeline& timeline, std::size_t index);

/// What follows the tool in that state's case, whose measurement is `result`. Refuses (usage) a state before
/// measurement or registration.
Expected<LiveTool> tool_of(const Timeline& timeline, const SessionState& state, const Result& result);

/// The tool at the newest poses, against the bone of the state's tunnel. Refuses as `LiveTool::overlay`.
Expected<ToolOverlay> overlay_of(const LiveTool& tool, const Timeline& timeline, const SessionState& state);

}  // namespace helicarm::gui
