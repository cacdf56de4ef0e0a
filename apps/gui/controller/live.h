// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <vector>

#include "helicarm/devices/robot/robot_link.h"
#include "helicarm/operation/connections.h"
#include "helicarm/operation/live_tool.h"

namespace helicarm::gui {

enum class Light { off, red, amber, green };

/// A device or a marker at this moment.
struct Lamp {
  QString name;
  Light light = Light::off;
  QString text;  ///< age or state, in words
  QString why;   ///< of red and amber
};

/// A pose up to so old steers a robot; up to the other it is worth a warning.
inline constexpr double fresh_s = 0.1;
inline constexpr double late_s = 1;

/// The markers that the plan names; the calibrator is seen where one of its facets is.
std::vector<Lamp> tracker_lamps(const TrackerPlan& plan, const std::vector<ToolState>& tools);
Lamp robot_lamp(const RobotLinkStatus& status);
/// At this moment, monotonic seconds.
Lamp c_arm_lamp(const CArmStatus& status, double now_s);

/// "23 ms", "4.1 s", "not seen".
QString age_text(const std::optional<double>& age_s);

}  // namespace helicarm::gui
