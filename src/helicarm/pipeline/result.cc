// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/result.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/core/output.h"
#include "helicarm/fiducials/candidates.h"
#include "helicarm/guidance/bone_check_description.h"
#include "helicarm/pipeline/calibrate_case.h"
#include "helicarm/pipeline/diagnosis/advice.h"
#include "helicarm/pipeline/result_description.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/pipeline/view_description.h"
#include "helicarm/pipeline/view_parameters.h"

namespace helicarm::pipeline {

std::vector<detection::Dot> unlabelled_candidates(const ViewResult& view) {
  if (view.found || view.calibrated || !view.dots || !view.rectification) return {};
  return fiducials::ball_candidates(*view.dots, *view.rectification);
}

std::vector<std::pair<guidance::Bone, TunnelByBone>> ends_in_bones(const guidance::Tunnel& tunnel) {
  std::vector<std::pair<guidance::Bone, TunnelByBone>> bones;
  for (const auto& [bone, start] : tunnel.start_in_bones)
    if (const auto end = tunnel.end_in_bones.find(bone); end != tunnel.end_in_bones.end())
      bones.push_back({bone, {&start, &end->second}});
  return bones;
}

namespace {

using output::if_set;

std::vector<std::pair<std::string, fiducials::ImagePoint>> seen_by_view(
    const PointResult& point, const std::vector<ViewResult>& views) {
  std::vector<std::pair<std::string, fiducials::ImagePoint>> seen;
  for (std::size_t i = 0; i < point.seen.size(); ++i)
    if (point.seen[i]) seen.push_back({views[i].name, *point.seen[i]});
  return seen;
}

/// In which images the point is seen.
template <class Output>
void describe_observations(Output& output, const PointResult& point, const std::vector<ViewResult>& views) {
  output.value(
      "views",
      [&] {
        std::vector<std::string> names;
        for (const auto& [view, seen] : seen_by_view(point, views)) names.push_back(view);
        return names;
      },
      "names of the views that show it");
  output.map(
      "seen", [&] { return seen_by_view(point, views); }, "for each of them",
      [](auto& row, const fiducials::ImagePoint& seen) {
        row.value("uv_raw", seen.uv_raw, "raw pixel");
        row.value("uv", seen.uv, "rectified");
        row.value("sigma_px", seen.sigma_px, "standard deviation per axis");
      });
}

template <class Output>
void describe_point(Output& output, const PointResult& point, const Result& result) {
  using guidance::PointInFrames;
  const auto& located = point.place;
  output.value("name", point.name, "of a pick or a target of the calibrator");
  output.word(
      "source", [&] { return word(point.source); }, localization::source_words, "");
  output.value("xyz_mm", if_set(located, &PointInFrames::in_calibrator),
               "at the time of the first view; `null` if not located");
  output.value("frame", "calibrator", "of `xyz_mm`");
  output.value("covariance_mm2", if_set(located, &PointInFrames::covariance_in_calibrator), "");
  output.value(
      "sigma_mm",
      if_set(located, [](const PointInFrames& of) { return sigmas<3>(of.covariance_in_calibrator); }),
      "square roots of its diagonal");
  output.value(
      "error_95_mm",
      if_set(located,
             [](const PointInFrames& of) { return localization::length_at_95(of.covariance_in_calibrator); }),
      "length that 95 % of errors with this covariance do not exceed");
  output.value(
      "ray_gap_mm", if_set(located, [&](const PointInFrames&) { return point.ray_gap_mm; }),
      "largest distance between two of the rays; with two views `error_95_mm` is never below half of it");
  describe_observations(output, point, result.views);
  output.value("reason", if_set(point.reason, [](const Failure& of) { return code(of.reason); }),
               "why it was not located: [reasons](reasons.md)");
  output.value("message", if_set(point.reason, &Failure::message), "likewise, for people");
  describe_failures(output, "warnings", point.warnings, "that concern this point");
  describe_failures(output, "notes", point.notes, "likewise");
  describe_in_frames(output, located ? &*located : nullptr, result.bones);
}

template <class Output>
void describe_statistics(Output& output, const char* key, const localization::Statistics& statistics,
                         const char* help) {
  output.object(key, statistics.n > 0, help, [&](auto& row) {
    row.value("mean", statistics.mean, "");
    row.value("rms", statistics.rms, "");
    row.value("max", statistics.max, "");
    row.value("min", statistics.min, "");
    row.value("n", statistics.n, "number of values");
  });
}

template <class Output>
void describe_accuracy(Output& output, const localization::Accuracy& accuracy) {
  describe_statistics(output, "fle_px", accuracy.fle_px, "Eq. 10; `null` without measurements");
  describe_statistics(output, "fre_mm", accuracy.fre_mm, "Eq. 11; likewise");
  describe_statistics(output, "tre_mm", accuracy.tre_mm, "Eq. 12; likewise");
  output.list("targets", accuracy.targets, "of the calibrator, with known places",
              [](auto& row, const localization::TargetError& target) {
                row.value("name", target.name, "");
                row.value("error_mm", target.error_mm, "measured");
                row.value("predicted_mm", target.predicted_mm, "rms error by the covariance");
                row.value("predicted_95_mm", target.predicted_95_mm, "exceeded by 5 % of the errors");
              });
}

template <class Output>
void describe_verification(Output& output, const guidance::Verification& verification,
                           const std::vector<ViewResult>& views) {
  using guidance::LineError;
  const auto per_view = [&](const std::optional<LineError>& error) {
    std::vector<std::pair<std::string, std::optional<double>>> by_view;
    for (std::size_t i = 0; i < views.size(); ++i)
      by_view.push_back({views[i].name, error ? error->per_view_px[i] : std::nullopt});
    return by_view;
  };
  const std::optional<LineError>&start = verification.start, &end = verification.end;
  output.value("name", verification.name, "of the tool line");
  output.value(
      "start_px", [&] { return per_view(start); }, "per view, in rectified pixels");
  output.value(
      "end_px", [&] { return per_view(end); }, "likewise");
  output.value("err_start_px", if_set(start, &LineError::combined_px), "Eq. 17");
  output.value("err_end_px", if_set(end, &LineError::combined_px), "likewise");
  output.value("err_start_mm", if_set(start, &LineError::combined_mm), "likewise, at the point's depth");
  output.value("err_end_mm", if_set(end, &LineError::combined_mm), "likewise");
  output.value("distance_start_mm", if_set(start, &LineError::distance_mm), "in space");
  output.value("distance_end_mm", if_set(end, &LineError::distance_mm), "likewise");
  const auto& depth = verification.depth;
  output.value_where(depth.has_value(), "beyond_end_mm", if_set(depth, &guidance::TipDepth::beyond_end_mm),
                     "of a drill held by hand in an operation: its tip beyond the planned end along the "
                     "tunnel, negative before it");
  output.value_where(depth.has_value(), "depth_error_95_mm", if_set(depth, &guidance::TipDepth::error_95_mm),
                     "likewise, what 95 % of its errors do not exceed");
  output.value_where(depth.has_value(), "depth_tolerance_mm",
                     if_set(depth, &guidance::TipDepth::tolerance_mm), "likewise, of the plan");
}

template <class Output>
void describe_calibrator(Output& output, const CalibratorSource& calibrator) {
  output.value("name", calibrator.name, "of the [calibrator.json](#calibratorjson)");
  output.value("tolerance_mm", calibrator.tolerance_mm, "of its fiducials, per axis");
  output.value(
      "scale_sigma",
      [&] { return calibrator.scale_sigma > 0 ? std::optional(calibrator.scale_sigma) : std::nullopt; },
      "of its size; `null`: none stated");
  output.value("measured", calibrator.measured, "how its coordinates were obtained; `null`: not stated");
  output.list("balls", calibrator.balls, "its fiducials", [](auto& row, const phantom::CalibratorBall& ball) {
    row.value("label", ball.label, "");
    row.value("xyz_mm", ball.centre_in_calibrator, "");
    row.value("diameter_mm", ball.diameter_mm, "");
  });
}

template <class Output>
void describe_variation(Output& output, const char* key, const calibration::IntrinsicsVariation& sigma,
                        const char* help) {
  output.object(key, true, help, [&](auto& row) {
    row.value("common_mm", sigma.common, "of all views alike");
    row.value("of_view_mm", sigma.of_view, "of each view by itself");
  });
}

template <class Output>
void describe_machine(Output& output, const std::optional<calibration::LearnedIntrinsics>& history) {
  const calibration::IntrinsicsVariation none{};
  output.value(
      "focal_mm", [&] { return history->mean_mm().x(); },
      "distance of source and receiver, in the first view");
  output.value(
      "principal_mm", [&]() -> Eigen::Vector2d { return history->mean_mm().tail<2>(); }, "principal point");
  describe_variation(output, "focal_sigma", history ? *history->deviation.prior.focal : none,
                     "standard deviations");
  describe_variation(output, "principal_sigma", history ? *history->deviation.prior.principal : none,
                     "likewise");
}

template <class Output>
void describe_calibration(Output& output, const CaseCalibration& calibration) {
  const auto if_known = [&](auto value) { return calibration.dof > 0 ? std::optional(value) : std::nullopt; };
  output.object("calibration", true, "of all views together", [&](auto& row) {
    row.value(
        "joint_covariance",
        [&] {
          const Eigen::MatrixXd& covariance = calibration.joint_covariance;
          return covariance.size() > 0 ? std::optional(covariance) : std::nullopt;
        },
        "of all views' parameters, 11 per view: fx, fy, u0, v0 (px), rotation vector in the camera frame "
        "(rad), "
        "translation (mm), skew (px); `null` with `--method paper`");
    row.value("chi2", if_known(calibration.chi2), "");
    row.value("dof", if_known(calibration.dof), "degrees of freedom of `chi2`");
    row.value("variance_scale", if_known(calibration.variance_scale),
              "factor of all covariances where chi2 contradicts the sigmas, else 1");
  });
  output.object("machine", calibration.history.has_value(),
                "prior from the C-arm history (`--machine`); `null` without one",
                [&](auto& row) { describe_machine(row, calibration.history); });
  output.value(
      "acquisitions", [&] { return calibration::acquisitions_json(calibration.entries); },
      "what the views alone say of the C-arm, for `helicarm c-arm add`: entries as `shots` of "
      "[machine.json](#machinejson); empty where the residuals contradict the noise model, or pixel size or "
      "source distance is not known");
}

template <class Output>
void describe_tunnels(Output& output, const Result& result) {
  std::vector<ModelTunnel> tunnels;
  for (const guidance::Tunnel& tunnel : result.tunnels)
    tunnels.push_back({.model = {}, .tunnel = tunnel, .ends = {}});
  tunnels.insert(tunnels.end(), result.model_tunnels.begin(), result.model_tunnels.end());
  output.list(
      "tunnels", tunnels,
      "the picked ones, then those of registered models' plans; a model refused for a `tunnel_breach` "
      "alone shows its tunnels too",
      [](auto& row, const ModelTunnel& planned) {
        const bool is_planned = !planned.model.empty();
        describe_tunnel(row, planned.tunnel);
        row.value_where(is_planned, "model", planned.model, "whose plan holds it");
        row.object_where(
            is_planned, "bone_check", planned.bone_check,
            "[the tunnel against the bone](#bone_check), see below",
            [](auto& check, const guidance::BoneCheck& of) { guidance::describe_bone_check(check, of); });
      });
}

template <class Output>
void describe_timing(Output& output, const Timing& timing) {
  output.value("read", timing.read, "");
  output.value("rectify", timing.rectify, "chooses the plate's dots, and fits the map");
  output.value("detect", timing.detect, "finds all dots");
  output.value("label", timing.label, "assigns the fiducials' labels");
  output.value("calibrate", timing.calibrate, "");
  output.value("locate", timing.locate, "");
  output.value("total", timing.total, "");
}

template <class Output>
void describe_options(Output& output, const RunOptions& options) {
  output.word(
      "method", [&] { return word(options.method); }, rectification::method_words, "");
  output.value("max_error_mm", options.max_error_mm, "limit of a point's error; `null`: none");
  output.value("motion_sigma_mm", options.motion_sigma_mm, "of a bone without poses");
  output.value("threads", options.threads, "0: all cores");
}

template <class Output>
void describe_result(Output& output, const Result& result) {
  output.value("format", "helicarm-result/1", "");
  describe_verdict(output, result.failure);
  const Advice advice = advice_for(result);
  output.value("causes", advice.causes, "of a refusal: likely causes, the likeliest first; else empty");
  output.value(
      "next", [&] { return advice.next.empty() ? std::nullopt : std::optional(advice.next); },
      "of a refusal: the next step");
  describe_failures(output, "warnings", result.warnings, "each with the fields of `failure`");
  describe_failures(output, "notes", result.notes,
                    "likewise: limitations that hold for any data of this kind, and deviations within stated "
                    "tolerances; see [notes](reasons.md#notes)");
  output.object("calibrator", true, "", [&](auto& row) { describe_calibrator(row, result.calibrator); });
  output.list("views", result.views, "see below",
              [](auto& row, const ViewResult& view) { describe_view(row, view); });
  static const CaseCalibration none{};
  describe_calibration(output, result.calibration ? *result.calibration : none);
  output.list("points", result.points, "one per pick name and one per target of the calibrator; see below",
              [&](auto& row, const PointResult& point) { describe_point(row, point, result); });
  output.object("accuracy", true, "", [&](auto& row) { describe_accuracy(row, result.accuracy); });
  describe_tunnels(output, result);
  output.list("verification", result.verifications, "of each tool line",
              [&](auto& row, const guidance::Verification& verification) {
                describe_verification(row, verification, result.views);
              });
  output.object("timing_ms", true, "wall clock; `null`: not reached",
                [&](auto& row) { describe_timing(row, result.timing_ms); });
  output.value("version", HELICARM_VERSION, "of the program");
  output.object("options", true, "of the run", [&](auto& row) { describe_options(row, result.options); });
}

}  // namespace

geometry::View view_of_bone(const Result& result, std::size_t index,
                            const std::optional<guidance::Bone>& bone) {
  geometry::View view = result.views[index].calibrated.value().view;
  if (index == 0 || !bone) return view;
  const auto &first = result.views.front().calibrator_from_bone,
             &seen = result.views[index].calibrator_from_bone;
  if (const auto then = first.find(*bone), now = seen.find(*bone); then != first.end() && now != seen.end())
    view.camera_from_world = view.camera_from_world * now->second * then->second.inverse();
  return view;
}

std::vector<geometry::View> views_of_bone(const Result& result, const std::optional<guidance::Bone>& bone) {
  std::vector<geometry::View> views;
  for (std::size_t i = 0; i < result.views.size(); ++i) views.push_back(view_of_bone(result, i, bone));
  return views;
}

Eigen::MatrixXd joint_covariance(const Result& result) {
  return result.calibration ? result.calibration->joint_covariance : Eigen::MatrixXd();
}

Json to_json(const Failure& failure) {
  return output_of([&](OutputJson& output) { describe_failure(output, failure); });
}

Json to_json(const Result& result) {
  return output_of([&](OutputJson& output) { describe_result(output, result); });
}

Json result_schema() {
  return output_schema("result.json", [](OutputSchema& output) { describe_result(output, Result()); });
}

}  // namespace helicarm::pipeline
