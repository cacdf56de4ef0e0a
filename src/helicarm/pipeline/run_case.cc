// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/run_case.h"

#include "helicarm/pipeline/locate_case.h"
#include "helicarm/pipeline/stopwatch.h"

namespace helicarm::pipeline {

Expected<Result> run_case(const Case& given, const RunOptions& options) {
  return run_and_keep(given, options).map([](CalibratedResult done) { return std::move(done.result); });
}

Expected<CalibratedResult> run_and_keep(const Case& given, const RunOptions& options) {
  std::optional<double> total;
  auto done = timed(total, [&]() -> Expected<CalibratedResult> {
    auto calibration = calibrate_case(given, options);
    const auto with = [](std::optional<CaseCalibration> kept) {
      return [kept = std::move(kept)](Result result) mutable {
        return CalibratedResult{std::move(result), std::move(kept)};
      };
    };
    if (!calibration)
      return result_of_refusal(given, std::move(calibration).error(), options).map(with(std::nullopt));
    auto result = locate_case(given, *calibration, options);
    return std::move(result).map(with(*std::move(calibration)));
  });
  if (done) done->result.timing_ms.total = total;
  return done;
}

}  // namespace helicarm::pipeline
