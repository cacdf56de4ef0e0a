// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/run_case.h"

#include "helicarm/pipeline/locate_case.h"
#include "helicarm/pipeline/stopwatch.h"

namespace helicarm::pipeline {

Expected<Result> run_case(const Case& given, const RunOptions& options) {
  std::optional<double> total;
  auto result = timed(total, [&]() -> Expected<Result> {
    auto calibration = calibrate_case(given, options);
    if (calibration) return locate_case(given, *calibration, options);
    return result_of_refusal(given, std::move(calibration).error(), options);
  });
  if (result) result->timing_ms.total = total;
  return result;
}

}  // namespace helicarm::pipeline
