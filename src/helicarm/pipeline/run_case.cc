// SPDX-License-Identifier: Apache-2.0
#include "helicarm/navigation/run_case.h"

#include "helicarm/navigation/each_view.h"
#include "helicarm/navigation/outcome.h"
#include "helicarm/navigation/points.h"
#include "helicarm/navigation/view_stages.h"
#include "helicarm/xray/read_exposure.h"

namespace helicarm {
namespace {

void append(std::vector<Warning>& warnings, const std::vector<Warning>& more) {
  warnings.insert(warnings.end(), more.begin(), more.end());
}

void run_stages(const Case& given, Result& result) {
  const RunOptions& options = result.options;
  Timing& time = result.timing_ms;
  const Stopwatch whole(time.total);
  const EachView each_view(given, result);

  each_view(time.read, [&](const CaseView& from, ViewResult& view) {
    view.exposure = value_or_throw(read_exposure(from.image, from.name, from.frame));
  });
  append(result.warnings, value_or_throw(check_pictures_belong_together(result.views)));

  each_view(time.rectify, [&](const CaseView& from, ViewResult& view) {  // 2.1, Eq. 1-3
    view.rectification =
        value_or_throw(rectify_view(*view.exposure, from, given.plate, given.calibrator, options.method));
  });

  each_view(time.detect, [&](const CaseView&, ViewResult& view) {  // 2.1, 2.3.4
    view.found = value_or_throw(find_unless_ambiguous(view, given.calibrator, options.method));
  });
  // A view along the cone's axis is named with the help of another.
  const auto radius_bias = common_radius_bias(result.views);
  each_view(time.label, [&](const CaseView&, ViewResult& view) {
    if (!view.found)
      view.found = value_or_throw(
          find_fiducials(*view.exposure, *view.rectification, given.calibrator, options.method, radius_bias));
  });

  if (options.machine) result.machine = value_or_throw(recall_machine(result.views, *options.machine));
  const CalibrationResult calibration = timed(time.calibrate, [&] {  // 2.2, Eq. 4-7
    return value_or_throw(calibrate_views(result.views, given.calibrator, options.method, result.machine));
  });
  keep_calibration(calibration, result);
  if (options.machine && calibration.variance_scale == 1)
    result.shots = lessons_of(result.views, given.calibrator);

  timed(time.locate, [&] {  // Eq. 8, Eq. 16
    result.points = value_or_throw(see_points(given, result));
    append(result.warnings, locate_points(given, calibration, result.points));
  });
  result.accuracy = measure_accuracy(given.calibrator, calibration, result.points);  // Eq. 10-12
  append(result.warnings, doubts_of(given.calibrator, result));
  result.tunnel_ends = tunnel_ends(given.tunnels, result.points);
  result.tunnels = value_or_throw(plan_tunnels(given, result));                                // Eq. 16
  result.verifications = value_or_throw(verify_tool_lines(given, calibration.views, result));  // Eq. 17
  append(result.warnings, value_or_throw(check_certain(result.points, options.max_error_mm)));
}

}  // namespace

Expected<Result> run_case(const Case& given, const RunOptions& options) {
  Result result;
  result.options = options;
  result.warnings = given.warnings;
  result.tool_lines = given.tool_lines;
  for (const CaseView& view : given.views) result.views.push_back({view.name, {}, {}, {}, {}});
  const auto done = guarded([&] { run_stages(given, result); });
  if (!done && exit_code(done.error().reason) == 2) return tl::unexpected<Failure>(done.error());
  if (!done) result.failure = done.error();
  gather_warnings(result);
  return result;
}

}  // namespace helicarm
