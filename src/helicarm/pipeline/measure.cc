// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/measure.h"

#include <algorithm>

#include "helicarm/pipeline/locate_case.h"
#include "helicarm/pipeline/stopwatch.h"

namespace helicarm::pipeline {
namespace {

/// With the wall-clock time of `work`.
template <class Work>
Expected<Result> in_total(Work work) {
  std::optional<double> total;
  auto done = timed(total, work);
  if (done) done->timing_ms.total = total;
  return done;
}

/// Whether a calibration by the one options serves the others.
bool ask_for_one_calibration(const RunOptions& a, const RunOptions& b) {
  const auto same = [](const calibration::HistoryEntry& one, const calibration::HistoryEntry& other) {
    return one.image == other.image && one.estimate_mm == other.estimate_mm &&
           one.information == other.information && one.nominal_focal_mm == other.nominal_focal_mm &&
           one.calibrator == other.calibrator && one.by_calibrator.cols() == other.by_calibrator.cols() &&
           one.by_calibrator == other.by_calibrator;
  };
  return a.method == b.method && a.maps == b.maps && a.history.has_value() == b.history.has_value() &&
         (!a.history || std::ranges::equal(a.history->entries, b.history->entries, same));
}

}  // namespace

Expected<Result> measure(const Case& the_case, const RunOptions& options, const Progress& progress) {
  return in_total([&]() -> Expected<Result> {
    auto calibration = calibrate_case(the_case, options, progress);
    if (!calibration) return result_of_refusal(the_case, std::move(calibration).error(), options);
    return locate_case(the_case, std::make_shared<const CaseCalibration>(*std::move(calibration)), options,
                       progress);
  });
}

Expected<Result> measure_again(const std::optional<Result>& earlier, const Case& changed,
                               const RunOptions& options, const Progress& progress) {
  if (!earlier || !earlier->calibration || !ask_for_one_calibration(earlier->options, options))
    return measure(changed, options, progress);
  return in_total([&] { return locate_case(changed, earlier->calibration, options, progress); });
}

}  // namespace helicarm::pipeline
