// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/case_registration/plan.h"
#include "helicarm/case_registration/register_case.h"

namespace helicarm::case_registration {

/// The largest 95 % error of a planned point, and the frame in which it has it.
struct PlannedError {
  std::string point;
  std::string frame;
  double error_95_mm = 0;
};

/// Over all frames in which the points are written; nothing without points.
std::optional<PlannedError> largest_error(const std::vector<RegisteredPoint>& points);

/// Refuses the model (uncertain) if a planned point's error exceeds the limit in a frame in which it is
/// written; without a limit an error over `registration::usual_error_mm` is warned of.
void limit_error(const std::optional<PlannedError>& largest, const std::optional<double>& max_error_mm,
                 registration::Registration& result);

/// Of a model with a part that its pose does not explain: refuses a tunnel planned there, and warns of other
/// points (wrong_model).
void judge_explained(const MarkupPlan& plan, registration::Registration& result);

/// Adds a warning or, where `refuses`, the failure, if there is none yet; the decision follows.
void add_finding(registration::Registration& result, Failure finding, bool refuses);

}  // namespace helicarm::case_registration
