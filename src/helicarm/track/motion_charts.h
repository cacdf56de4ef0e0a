// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/report/chart.h"
#include "helicarm/track/sequence.h"

namespace helicarm::track {

/// A number and what it is, for the head of a report. `what` is HTML.
std::string report_card(const std::string& value, const std::string& what);

/// HTML of the warnings, empty without any.
std::string warnings_list(const std::vector<Warning>& warnings);

/// Three curves of a body's places, or of its rotation vectors, with their 95 % bars over the frames.
report::Chart pose_chart(const std::vector<int>& numbers, const std::vector<TrackedBody>& frames,
                         std::string title, bool turns);

/// For each body its smooth motion against the first frame with 95 % bars and the chart of its residuals,
/// then the motion of each further body in the first one's coordinates. `further`: charts of each
/// body behind these. HTML.
std::string motion_charts(const std::vector<int>& frames, const std::vector<std::string>& names,
                          const std::vector<BodySequence>& bodies,
                          const std::vector<std::vector<TrackedBody>>& relative,
                          const std::vector<report::Chart>& residuals,
                          const std::vector<std::vector<report::Chart>>& further = {});

}  // namespace helicarm::track
