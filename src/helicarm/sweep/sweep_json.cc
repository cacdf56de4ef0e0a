// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <string_view>

#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/core/output.h"
#include "helicarm/pipeline/result_description.h"
#include "helicarm/pipeline/view_parameters.h"
#include "helicarm/sweep/sweep.h"

namespace helicarm::sweep {
namespace {

using calibration::CalibratedView;
using output::if_set;

constexpr double degrees = 180 / EIGEN_PI;
constexpr std::array<std::string_view, 3> decision_words{"accept", "warn", "refuse"};

template <class Output>
void describe_camera(Output& output, const std::optional<CalibratedView>& camera) {
  using geometry::Intrinsics;
  output.value("reprojection_rms_px", if_set(camera, &CalibratedView::reprojection_rms_px), "");
  output.value("chi2", if_set(camera, &CalibratedView::chi2), "");
  output.value("dof", if_set(camera, &CalibratedView::dof), "expectation of `chi2`");
  output.value("projection", if_set(camera, [](const CalibratedView& of) { return of.view.projection(); }),
               "of the best estimate, as in [result.json](#resultjson); `null` if refused");
  pipeline::describe_parameters(output, camera, "likewise");
  output.object("intrinsics", camera.has_value(), "likewise", [&](auto& row) {
    const auto number = [&](const char* key, double Intrinsics::*which) {
      row.value(
          key, [&camera, which] { return camera->view.intrinsics.*which; }, "px");
    };
    number("fx_px", &Intrinsics::fx);
    number("fy_px", &Intrinsics::fy);
    number("u0", &Intrinsics::u0);
    number("v0", &Intrinsics::v0);
  });
  output.value(
      "camera_from_calibrator",
      if_set(camera,
             [](const CalibratedView& of) -> Eigen::Matrix4d { return of.view.camera_from_world.matrix(); }),
      "likewise, mm");
  output.value("source_mm",
               if_set(camera, [](const CalibratedView& of) { return of.view.source_in_world(); }),
               "in the calibrator's frame");
  const auto covariance = [](const CalibratedView& of) { return calibration::source_covariance(of); };
  output.value("source_sigma_mm",
               if_set(camera, [&](const CalibratedView& of) { return pipeline::sigmas<3>(covariance(of)); }),
               "standard deviations");
  output.value("source_covariance_mm2", if_set(camera, covariance), "");
}

template <class Output>
void describe_frame(Output& output, const SweepFrame& frame) {
  output.value("frame", frame.number, "its number in the file or of the file");
  output.value("view", frame.view, "`NAME/12`");
  output.word(
      "decision", [&] { return decision_words[std::size_t(frame.decision)]; }, decision_words,
      "`warn`: its residuals, or its distance from the path, are larger than usual; the covariance is "
      "inflated "
      "where residuals are");
  output.object_of("failure", frame.failure, "of a refused image",
                   [](auto& row, const Failure& why) { pipeline::describe_failure(row, why); });
  output.object("angle_deg", frame.primary_angle_deg || frame.secondary_angle_deg,
                "as the file states; `null`: not stated", [&](auto& row) {
                  row.value("primary", frame.primary_angle_deg, "");
                  row.value("secondary", frame.secondary_angle_deg, "");
                });
  output.value("path_angle_deg", frame.path_angle_deg, "along the path, from the first image");
  output.value("fiducials_used", frame.fiducials_used, "number");
  describe_camera(output, frame.best);
  output.value("alone", if_set(frame.alone, [](const CalibratedView& of) { return of.view.projection(); }),
               "projection by this image alone");
  output.value(
      "off_path_sigma", frame.off_path_sigma,
      "distance of this image's own camera from the path of the others, as a standard normal deviate; "
      "`null` if free");
}

/// Columns over the accepted frames.
struct Flex {
  std::vector<double> angle_deg;
  std::vector<CameraVector> deviation;

  template <int first>
  std::vector<Eigen::Vector3d> part(double factor = 1) const {
    std::vector<Eigen::Vector3d> column;
    for (const CameraVector& each : deviation) column.emplace_back(each.segment<3>(first) * factor);
    return column;
  }
};

Flex flex_of(const Sweep& sweep) {
  Flex flex;
  for (const SweepFrame& frame : sweep.frames) {
    const std::optional<CameraVector>& deviation = frame.flex ? frame.flex : frame.own;
    if (!deviation || !frame.path_angle_deg || !frame.best) continue;
    flex.angle_deg.push_back(*frame.path_angle_deg);
    flex.deviation.push_back(*deviation);
  }
  return flex;
}

template <class Output>
void describe_path(Output& output, const SweepPath& path, const Sweep& sweep) {
  output.word(
      "kind", [&] { return path_words[std::size_t(path.kind)]; }, path_words, "");
  output.value("axis", path.axis, "unit vector; `null` where the camera does not turn");
  output.value("isocentre_mm", path.isocentre, "nearest to the central rays");
  output.value("isocentre_sigma_mm", path.isocentre_sigma, "jackknife over eighths of the run");
  output.value("isocentre_radius_mm", path.isocentre_radius_mm, "to the farthest central ray");
  output.value("source_to_axis_mm", path.source_to_axis_mm, "");
  output.value("source_to_detector_mm", path.source_to_detector_mm,
               "`null` where the pixel size is not known");
  output.value("arc_deg", path.arc_deg, "between the first and the last image");
  output.object("jitter", path.stiffness.has_value(),
                "standard deviation of an image about the path; `null` if free", [&](auto& row) {
                  row.value(
                      "source_mm", [&] { return path.stiffness->jitter[0]; }, "");
                  row.value(
                      "detector_mm", [&] { return path.stiffness->jitter[1]; }, "");
                  row.value(
                      "rotation_deg", [&] { return path.stiffness->jitter[2] * degrees; }, "");
                });
  const Flex flex = flex_of(sweep);
  output.object(
      "flex", true,
      "columns over the accepted images: the path's deviation from a camera that turns about the axis, in "
      "the camera's directions (right, down, to the detector); of a free path the images' own",
      [&](auto& row) {
        row.value("angle_deg", flex.angle_deg, "along the path");
        row.value(
            "source_mm", [&] { return flex.part<0>(); }, "");
        row.value(
            "detector_mm", [&] { return flex.part<3>(); }, "of the middle of the image");
        row.value(
            "rotation_deg", [&] { return flex.part<6>(degrees); }, "");
      });
}

template <class Output>
void describe_check(Output& output, const ReconstructionCheck& check) {
  output.value("program", check.program, "its version");
  output.value("images", check.images, "number used");
  output.value(
      "circle_ratio", [&] { return check.circle_ratio(); },
      "width by the ideal circle over that by these cameras, median of the targets");
  output.value(
      "other_ratio", [&] { return check.other_ratio(); }, "likewise by the other program's cameras");
  output.list("targets", check.targets, "balls and wire", [](auto& row, const CheckedTarget& target) {
    row.value("name", target.name, "label of the ball, or `wire`");
    row.value("diameter_mm", target.diameter_mm, "of a ball, by the calibrator's file");
    row.value("width_mm", target.own.width_mm, "at half maximum; `null`: not distinct from its surroundings");
    row.value("circle_width_mm", target.circle.width_mm, "likewise by the ideal circle");
    row.value(
        "other_width_mm", [&] { return target.other ? target.other->width_mm : std::nullopt; },
        "likewise by the other program's cameras; `null` without them");
  });
}

template <class Output>
void describe_sweep(Output& output, const Sweep& sweep) {
  output.value("format", "helicarm-sweep/1", "");
  pipeline::describe_verdict(output, sweep.failure);
  pipeline::describe_failures(output, "warnings", sweep.warnings,
                              "of the run; each code of refused images is a warning that names them");
  pipeline::describe_failures(output, "notes", sweep.notes, "of the run");
  output.value(
      "image_size", [&] { return sweep.detector.image_size; }, "columns and rows");
  output.value(
      "pixel_mm", [&] { return sweep.pixel_known ? std::optional(sweep.detector.pixel_mm) : std::nullopt; },
      "`null` where the pixel size is not known");
  output.value("noise_factor", sweep.noise_factor,
               "by which the standard deviations of the ball centres were multiplied, from all residuals");
  output.list("frames", sweep.frames, "in the order of the case; see below",
              [](auto& row, const SweepFrame& frame) { describe_frame(row, frame); });
  output.object_of("path", sweep.path, "see below",
                   [&](auto& row, const SweepPath& path) { describe_path(row, path, sweep); });
  output.value(
      "acquisitions", [&] { return calibration::acquisitions_json(sweep.acquisitions); },
      "as in [result.json](#resultjson), of up to 40 images, evenly spaced over the run");
  output.object_of("check", sweep.check, "of `--check FDK`, widths in a reconstruction; `null` without it",
                   [](auto& row, const ReconstructionCheck& check) { describe_check(row, check); });
  output.value("seconds", sweep.seconds, "wall-clock time");
  output.value("version", HELICARM_VERSION, "of the program");
}

}  // namespace

Json to_json(const Sweep& sweep) {
  return output_of([&](OutputJson& output) { describe_sweep(output, sweep); });
}

Json sweep_schema() {
  return output_schema("sweep.json", [](OutputSchema& output) { describe_sweep(output, Sweep()); });
}

}  // namespace helicarm::sweep
