// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <vector>

#include "gui/replay/timeline.h"
#include "helicarm/devices/robot/robot_link.h"
#include "helicarm/operation/connections.h"
#include "helicarm/operation/live_tool.h"

namespace helicarm::gui {

enum class Light { off, red, amber, green };

/// State of a device or marker at one time.
struct StatusIndicator {
  enum class Kind { marker, robot, c_arm };
  QString name;
  Light light = Light::off;
  QString text;  ///< age or state, as text
  QString why;   ///< reason for red and amber
  Kind kind = Kind::marker;
};

/// Greatest pose age for robot motion; up to the second limit the indicator is amber.
inline constexpr double fresh_s = 0.1;
inline constexpr double late_s = 1;

/// The markers of the plan; the calibrator is visible if one of its facets is.
std::vector<StatusIndicator> tracker_indicators(const operation::TrackerPlan& plan,
                                                const std::vector<tracker::ToolState>& tools);
StatusIndicator robot_indicator(const robot::RobotLinkStatus& status);
/// The markers of bones and tool that the tracker has looked for, at a moment of a recorded operation:
/// whether it saw them.
std::vector<StatusIndicator> recorded_indicators(const operation::TrackerPlan& plan,
                                                 const SessionState& then);
/// At this time, monotonic seconds.
StatusIndicator c_arm_indicator(const operation::CArmStatus& status, double now_s);

/// "23 ms", "4.1 s", "not visible".
QString age_text(const std::optional<double>& age_s);

}  // namespace helicarm::gui
