// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/locate_case.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/pipeline/diagnosis/calibrator_checks.h"
#include "helicarm/pipeline/outcome.h"
#include "helicarm/pipeline/points.h"
#include "helicarm/pipeline/stopwatch.h"

namespace helicarm::pipeline {
namespace {

void append(std::vector<Finding>& findings, const std::vector<Warning>& more, Stage stage,
            const std::string& view = {}) {
  for (Warning warning : more) {
    if (warning.view.empty()) warning.view = view;
    findings.push_back({std::move(warning), stage});
  }
}

/// What holds for any file of its kind: a DICOM file need not be compressed with loss, a JPEG file is.
bool is_note(const Warning& warning, const xray::XrayImage& image) {
  const bool is_dicom = !image.acquisition.uid_key.empty();
  return warning.reason == Reason::irregular_file || (warning.reason == Reason::lossy_image && !is_dicom);
}

/// Of the images' files: the notes, or all but these.
void append_of_files(std::vector<Finding>& findings, const std::vector<ViewResult>& views, bool notes) {
  for (const ViewResult& view : views) {
    if (!view.xray_image) continue;
    std::vector<Warning> chosen = view.xray_image->warnings;
    std::erase_if(chosen, [&](const Warning& each) { return is_note(each, *view.xray_image) != notes; });
    append(findings, chosen, Stage::read, view.name);
  }
}

/// Of reading, rectification and labelling.
void append_warnings(std::vector<Finding>& warnings, const std::vector<ViewResult>& views) {
  append_of_files(warnings, views, false);
  for (const ViewResult& view : views) {
    if (view.rectification) append(warnings, view.rectification->warnings, Stage::rectify, view.name);
    if (view.found) append(warnings, view.found->warnings, Stage::label, view.name);
  }
}

/// Distortion that the calibration finds was left by the rectification.
void append_warnings(std::vector<Finding>& warnings, const calibration::CalibrationResult& calibration) {
  for (const Warning& warning : calibration.warnings)
    warnings.push_back(
        {warning, warning.reason == Reason::residual_distortion ? Stage::rectify : Stage::calibrate});
}

Result initial_result(const Case& the_case, const RunOptions& options, std::vector<ViewResult> views) {
  Result result;
  result.options = options;
  result.bones = the_case.bones;
  result.calibrator = {the_case.calibrator.name, the_case.calibrator.tolerance_mm,
                       the_case.calibrator.scale_sigma, the_case.calibrator.measured,
                       the_case.calibrator.balls};
  result.views = std::move(views);
  result.tool_lines = the_case.tool_lines;
  append(result.warnings, the_case.warnings, Stage::read);
  append_warnings(result.warnings, result.views);
  append_of_files(result.notes, result.views, true);
  append(result.warnings, reused_uids(result.views), Stage::read);
  append(result.warnings, exchanged_views(result.views), Stage::read);
  return result;
}

Result initial_result(const Case& the_case, const CaseCalibration& calibration, const RunOptions& options) {
  std::vector<ViewResult> views;
  for (std::size_t i = 0; i < calibration.images.size(); ++i) {
    views.push_back(reported(calibration.images[i]));
    views[i].found->fiducials = calibration.fiducials[i];
    views[i].calibrated = calibration.views[i];
    const guidance::Poses& poses = the_case.views[i].poses;
    for (const auto& [bone, of_tracker] : poses.tracker_from_bone)
      if (const auto pose = guidance::calibrator_from(bone, poses))
        views[i].calibrator_from_bone[bone] = *pose;
  }
  Result result = initial_result(the_case, options, std::move(views));
  append_warnings(result.warnings, calibration);
  append(result.notes, calibration.notes, Stage::calibrate);
  result.timing_ms = calibration.timing_ms;
  return result;
}

/// `read_case` refuses such a case; picks may have changed since.
Expected<void> check_tunnel_ends(const Case& the_case) {
  for (const CaseTunnel& tunnel : the_case.tunnels)
    for (const std::string& end : {tunnel.start, tunnel.end})
      if (std::ranges::find(the_case.picks, end, &Pick::name) == the_case.picks.end())
        return fail(Reason::bad_value,
                    fmt::format("tunnel \"{}\": \"{}\" is not a pick of the case", tunnel.name, end));
  return {};
}

}  // namespace

Expected<Result> locate_case(const Case& the_case, std::shared_ptr<const CaseCalibration> calibrated,
                             const RunOptions& options, const Progress& progress) {
  const CaseCalibration& calibration = *calibrated;
  if (auto valid = check_tunnel_ends(the_case); !valid)
    return tl::unexpected<Failure>(std::move(valid).error());
  progress.begin("locate");
  Result result = initial_result(the_case, calibration, options);
  result.calibration = std::move(calibrated);
  const auto located = timed(result.timing_ms.locate, [&] {
    return observe_points(the_case, calibration, options.threads).map([&](std::vector<PointResult> points) {
      append(result.warnings,
             locate_points(the_case, calibration, points, options.motion_sigma_mm),  // Eq. 8, Eq. 16
             Stage::locate);
      append(result.warnings, picks_on_fiducials(the_case, calibration, points), Stage::locate);
      append(result.notes, note_motion(the_case, calibration, points, options.motion_sigma_mm),
             Stage::locate);
      result.points = std::move(points);
    });
  });
  if (!located) return tl::unexpected<Failure>(located.error());
  result.accuracy = measure_accuracy(the_case.calibrator, calibration, result.points);  // Eq. 10-12
  append(result.warnings, diagnose(the_case, result), Stage::calibrate);
  append(result.notes, handedness_notes(calibration), Stage::label);
  append(result.notes, one_view_notes(calibration), Stage::calibrate);
  append(result.notes, scale_notes(the_case, calibration, result.points), Stage::calibrate);
  result.tunnel_ends = tunnel_ends(the_case.tunnels, result.points);
  const auto done = check_picks_agree(result.points, calibration)
                        .and_then([&] { return plan_tunnels(the_case, result); })  // Eq. 16
                        .and_then([&](std::vector<guidance::Tunnel> tunnels) {
                          result.tunnels = std::move(tunnels);
                          return verify_tool_lines(the_case, result);  // Eq. 17
                        })
                        .and_then([&](std::vector<guidance::Verification> verifications) {
                          append(result.warnings, lines_off_plan(verifications), Stage::locate);
                          result.verifications = std::move(verifications);
                          return check_certain(result.points, options.max_error_mm, the_case.calibrator);
                        })
                        .map([&](const std::vector<Warning>& warnings) {
                          append(result.warnings, warnings, Stage::locate);
                        });
  if (!done) result.failure = done.error(), result.refused_at = Stage::locate;
  return result;
}

Expected<Result> result_of_refusal(const Case& the_case, Refusal refusal, const RunOptions& options) {
  if (exit_code(refusal.failure.reason) == 2) return tl::unexpected<Failure>(refusal.failure);
  Result result = initial_result(the_case, options, std::move(refusal.views));
  result.failure = std::move(refusal.failure);
  result.refused_at = refusal.stage;
  result.timing_ms = refusal.timing_ms;
  return result;
}

}  // namespace helicarm::pipeline
