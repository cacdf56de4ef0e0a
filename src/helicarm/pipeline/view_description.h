// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include "helicarm/core/output.h"
#include "helicarm/fiducials/status_words.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/pipeline/view_parameters.h"

namespace helicarm::pipeline {

/// Descriptions (core/output.h) of a view of result.json.

inline constexpr std::array<std::string_view, 2> plane_words{"plate", "detector"};
inline constexpr std::array<std::string_view, 5> map_sources{"none", "plate", "plate_image", "file",
                                                             "record"};
template <class Output>
void describe_rectification(Output& output,
                            const std::optional<rectification::Rectification>& rectification) {
  using rectification::DistortionMap;
  using rectification::Rectification;
  const DistortionMap* const map = rectification ? &rectification->map : nullptr;
  const DistortionMap* const fitted = map && !map->is_identity() ? map : nullptr;
  const Rectification* const of_fitted = fitted ? &*rectification : nullptr;
  const auto number = [&](const char* key, const auto& of, auto part, const char* help) {
    output.value(key, helicarm::output::if_set(of, part), help);
  };
  output.value(
      "model", [&] { return std::string(map->model->name()); }, "of the distortion");
  output.word(
      "source",
      helicarm::output::if_set(rectification ? &*rectification : nullptr,
                               [](const Rectification& of) { return map_sources[std::size_t(of.source)]; }),
      map_sources, "of the map: `record` is that of a C-arm, `none` a flat panel");
  output.value(
      "dots_found", [&] { return rectification->dots_found; }, "of the plate");
  number("dots_expected", rectification, &Rectification::dots_expected,
         "of the plate; `null`: unbounded lattice");
  number("residual_rms_px", fitted, &DistortionMap::residual_rms_px, "of the map at the dots");
  number("residual_max_px", fitted, &DistortionMap::residual_max_px, "likewise, the largest");
  number("held_out_rms_px", fitted, &DistortionMap::held_out_rms_px, "at dots that the fit had not");
  number("raw_mean_px", of_fitted, &Rectification::raw_mean_px,
         "the distortion: mean distance from raw to rectified over the dots; of a map that is not by dots of "
         "this image over their field");
  number("raw_max_px", of_fitted, &Rectification::raw_max_px, "likewise, the largest");
  number("rectified_pixel_mm", map, &DistortionMap::rectified_pixel_mm,
         "of the rectified image, in its plane");
  output.word("rectified_plane",
              helicarm::output::if_set(
                  map,
                  [](const DistortionMap& of) -> std::optional<std::string_view> {
                    if (!of.rectified_plane) return {};
                    return plane_words[*of.rectified_plane == rectification::RectifiedPlane::plate ? 0 : 1];
                  }),
              plane_words, "the plane of that pixel size");
  output.value(
      "map", [&] { return rectification::to_json(*map); }, "as [map.json](#mapjson)");
}

template <class Output>
void describe_fiducial(Output& output, const fiducials::Fiducial& fiducial) {
  using fiducials::Fiducial;
  const bool is_seen = fiducial.status == fiducials::FiducialStatus::used ||
                       fiducial.status == fiducials::FiducialStatus::rejected;
  const Fiducial* const seen = is_seen ? &fiducial : nullptr;
  output.value("label", fiducial.label, "as in the calibrator");
  output.word(
      "status", [&] { return fiducials::word(fiducial.status); }, fiducials::status_words,
      "the pixels below are given if it is used or rejected");
  output.value(
      "uv_raw", helicarm::output::if_set(seen, &Fiducial::uv_raw),
      "raw pixel of the image of the fiducial's **centre** (`--method paper`: of the circle found on the "
      "rectified image)");
  output.value("uv", helicarm::output::if_set(seen, &Fiducial::uv), "likewise, rectified");
  output.value("sigma_px", helicarm::output::if_set(seen, &Fiducial::sigma_px),
               "standard deviation per axis, rectified");
  output.value("residual_px", helicarm::output::if_set(seen, &Fiducial::residual_px),
               "distance from the view's projection");
}

/// f_mm uses the pixel size on the detector: of the rectified image if known there, else of the file.
inline std::optional<double> pixel_on_detector_mm(const ViewResult& view) {
  const rectification::DistortionMap& map = view.rectification->map;
  if (map.rectified_plane == rectification::RectifiedPlane::detector && map.rectified_pixel_mm)
    return map.rectified_pixel_mm;
  if (view.xray_image && view.xray_image->acquisition.pixel_mm)
    return view.xray_image->acquisition.pixel_mm->y();
  return {};
}

template <class Output>
void describe_intrinsics(Output& output, const ViewResult& view) {
  const auto number = [&](const char* key, double geometry::Intrinsics::*which, const char* help) {
    output.value(
        key, [&view, which] { return view.calibrated->view.intrinsics.*which; }, help);
  };
  number("fx_px", &geometry::Intrinsics::fx, "negative in a mirrored image");
  number("fy_px", &geometry::Intrinsics::fy, "");
  number("u0", &geometry::Intrinsics::u0, "px");
  number("v0", &geometry::Intrinsics::v0, "px");
  output.value(
      "f_mm",
      [&] {
        const auto pixel_mm = pixel_on_detector_mm(view);
        return pixel_mm ? std::optional(view.calibrated->view.intrinsics.fy * *pixel_mm) : std::nullopt;
      },
      "distance of source and receiver; `null` where the pixel size is not known");
  output.value(
      "pixel_mm", [&] { return pixel_on_detector_mm(view); }, "on the receiver");
}

/// Candidates and best labels, of a view whose labelling was refused.
template <class Output>
void describe_guess(Output& output, const ViewResult& view) {
  const bool is_refused = !view.found && view.rectification;
  output.list(
      "candidates", [&] { return is_refused ? std::optional(unlabelled_candidates(view)) : std::nullopt; },
      "of a view whose labelling was refused: what may be a fiducial; else `null`",
      [](auto& row, const detection::Dot& dot) {
        row.value("uv_raw", dot.centre_px, "raw pixel");
        row.value("radius_px", dot.radius_px, "");
      });
  output.list(
      "guessed", [&] { return is_refused ? view.guessed : std::vector<fiducials::GuessedLabel>(); },
      "of such a view: the labels that explain the image best, which must not be used",
      [](auto& row, const fiducials::GuessedLabel& guess) {
        row.value("label", guess.label, "as in the calibrator");
        row.value("uv_raw", guess.uv_raw, "raw pixel");
        row.value("residual_px", guess.residual_px, "from the fiducial's projection");
      });
}

template <class Output>
void describe_labelling(Output& output, const std::optional<fiducials::LabelledFiducials>& found) {
  using fiducials::LabelledFiducials;
  output.value(
      "false_blobs",
      helicarm::output::if_set(found, [](const LabelledFiducials& of) { return of.false_blobs.size(); }),
      "number of candidates that are not fiducials");
  output.value("mirrored", helicarm::output::if_set(found, &LabelledFiducials::mirrored),
               "whether the stored image is mirrored");
  output.object("labelling", found.has_value(),
                "its evidence ([method](method.md#4-labelling)); `null` where it was refused",
                [&](auto& row) {
                  row.value(
                      "margin", [&] { return found->margin; },
                      "log odds against the second-best labelling; without one, against chance");
                  row.value(
                      "runner_up_matched", [&] { return found->runner_up_matched; },
                      "fiducials that the second-best one matches; 0: there is none");
                  row.value(
                      "runner_up_rms_px", [&] { return found->runner_up_rms_px; }, "at this distance");
                });
}

template <class Output>
void describe_calibrated(Output& output, const ViewResult& view) {
  using calibration::CalibratedView;
  const std::optional<CalibratedView>& calibrated = view.calibrated;
  output.value(
      "projection",
      helicarm::output::if_set(calibrated, [](const CalibratedView& of) { return of.view.projection(); }),
      "calibrator (mm) to rectified pixels; the third row's first three numbers have unit norm");
  output.value("dlt", helicarm::output::if_set(calibrated, &CalibratedView::dlt),
               "A1 to A11 of Eq. 6, or `null` if t_z = 0");
  output.object("intrinsics", calibrated.has_value(), "", [&](auto& row) { describe_intrinsics(row, view); });
  output.value("camera_from_calibrator",
               helicarm::output::if_set(calibrated,
                                        [](const CalibratedView& of) -> Eigen::Matrix4d {
                                          return of.view.camera_from_world.matrix();
                                        }),
               "mm");
  output.value("reprojection_rms_px",
               helicarm::output::if_set(calibrated, &CalibratedView::reprojection_rms_px),
               "of the fiducials used");
  output.value("chi2", helicarm::output::if_set(calibrated, &CalibratedView::chi2),
               "of the residuals from the fiducials' estimated positions (those of the file unless it states "
               "tolerances)");
  output.value("dof", helicarm::output::if_set(calibrated, &CalibratedView::dof),
               "expectation of `chi2` in the joint fit");
  output.value("condition", helicarm::output::if_set(calibrated, &CalibratedView::condition),
               "as in [method.md](method.md#6-calibration-22)");
  output.word("method",
              helicarm::output::if_set(
                  calibrated,
                  [](const CalibratedView& of) { return rectification::method_words[of.by_paper ? 1 : 0]; }),
              rectification::method_words,
              "by which the view was calibrated; points of views by `paper` follow from Eq. 8");
  describe_parameters(output, calibrated, "`null` with `--method paper`");
}

template <class Output>
void describe_view(Output& output, const ViewResult& view) {
  output.value("name", view.name, "as in the case");
  output.value("image_size",
               helicarm::output::if_set(view.xray_image,
                                        [](const xray::XrayImage& image) {
                                          return std::array{image.pixels.width(), image.pixels.height()};
                                        }),
               "width, height");
  output.object("rectification", view.rectification.has_value(), "",
                [&](auto& row) { describe_rectification(row, view.rectification); });
  output.list(
      "fiducials", [&] { return view.found ? view.found->fiducials : std::vector<fiducials::Fiducial>(); },
      "of the calibrator; empty where the labelling was refused",
      [](auto& row, const fiducials::Fiducial& fiducial) { describe_fiducial(row, fiducial); });
  describe_guess(output, view);
  describe_labelling(output, view.found);
  describe_calibrated(output, view);
  output.value(
      "calibrator_from_bone",
      [&] {
        std::vector<std::pair<std::string, Eigen::Matrix4d>> poses;
        for (const auto& [bone, pose] : view.calibrator_from_bone) poses.emplace_back(bone, pose.matrix());
        return poses;
      },
      "of each bone with a marker: its pose at the acquisition, mm; empty without the case's `poses`");
}

}  // namespace helicarm::pipeline
