// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/diagnosis/advice.h"

#include <algorithm>

#include <fmt/format.h>

namespace helicarm::pipeline {
namespace {

bool has_figure(const Failure& failure, const char* name) {
  const auto found = failure.figures.find(name);
  return found != failure.figures.end() && found->second != 0;
}

const ViewResult* view_of(const Result& result) {
  const auto found = std::ranges::find(result.views, result.failure->view, &ViewResult::name);
  return found == result.views.end() ? nullptr : &*found;
}

/// "11 of 12 balls": what the best labels found in the refused view.
std::string guessed_share(const Result& result) {
  const ViewResult* view = view_of(result);
  if (!view || view->guessed.empty()) return "none of the balls";
  return fmt::format("{} of {} balls", view->guessed.size(), result.calibrator.balls.size());
}

Advice of_plate(const Result& result) {
  if (has_figure(*result.failure, "residual_rms_px"))  // of a plate in the image, after rectification
    return {{"the case names no plate although the image shows one",
             "the map or the image of the plate is of another C-arm position"},
            "name the plate as \"plate\" in case.json, or make the map again in this position"};
  const bool mismatch = result.failure->reason == Reason::plate_mismatch;
  Advice advice{
      {"the case names another plate than the one in the image (pitch, lattice, balls or holes)",
       "the pixel size or the source distance of the image is wrong",
       "the image has no plate: a flat panel, or the plate was acquired apart",
       "shutters, metal or a resampled image hide the plate's lattice"},
      "compare plate.json with the plate and the image; for a flat panel set \"plate\": null, for an "
      "image of the plate alone name it as \"plate_image\""};
  if (has_figure(*result.failure, "fitting_pixel_mm"))
    std::swap(advice.causes[0], advice.causes[1]);
  else if (!mismatch && !has_figure(*result.failure, "dots_found"))
    std::rotate(advice.causes.begin(), advice.causes.begin() + 2, advice.causes.begin() + 3);
  return advice;
}

Advice of_ambiguous_labels(const Result& result) {
  Advice advice{
      {"the calibrator looks alike from this side: `helicarm phantom check` names its symmetries",
       "too few of its balls are in the field, or metal hides them",
       "calibrator.json describes another phantom, or deviates from it by more than its tolerance"},
      "turn the C-arm by 10 to 15 degrees and acquire the view again, with the whole calibrator in the "
      "field"};
  if (has_figure(*result.failure, "found")) {
    std::swap(advice.causes[0], advice.causes[1]);
    advice.causes[0] =
        "most balls were not found: out of the field, behind metal, too faint, or too small for the "
        "pixels";
    advice.next =
        "acquire the view again with the whole calibrator in the field, and with finer pixels or more dose "
        "where its balls are small or faint in the image";
  } else if (has_figure(*result.failure, "mirror_differs")) {
    advice.causes.insert(advice.causes.begin(), "it is not known whether the image is stored mirrored");
    advice.next = "state \"mirrored\" of the view in case.json";
  } else if (result.calibrator.tolerance_mm == 0 && has_figure(*result.failure, "runner_up_matched")) {
    advice.causes.push_back("a printed phantom without \"tolerance_mm\" in its file");
  }
  return advice;
}

Advice of_mismatch(const Result& result) {
  Advice advice{
      {"calibrator.json describes another phantom, or its coordinates are wrong (unit, sign of an axis)",
       "the pixel size or the source distance of the image is wrong",
       "the case names another plate than the one in the image, so that the map is wrong",
       "the image is not a view of the calibrator"},
      fmt::format(
          "open the overlay: orange circles are the candidates, and labels with a question mark the best "
          "guess ({}). If these labels are right, measure the calibrator again with `helicarm phantom "
          "measure`",
          guessed_share(result))};
  if (has_figure(*result.failure, "fitting_pixel_mm") ||
      has_figure(*result.failure, "fitting_source_detector_mm")) {
    std::swap(advice.causes[0], advice.causes[1]);
    advice.next =
        "compare the calibrator with its file first (number, diameter and places of the balls); correct the "
        "pixel "
        "size or the source distance only if another source, such as the C-arm's manual, confirms the new "
        "value";
  } else if (has_figure(*result.failure, "fitting_diameters")) {
    advice.causes.insert(advice.causes.begin(), "the balls' diameters in calibrator.json are wrong");
    advice.next = "measure a ball by caliper and correct \"diameter_mm\"";
  }
  return advice;
}

Advice of_few(const Result& result) {
  const ViewResult* view = view_of(result);
  const bool many = view && unlabelled_candidates(*view).size() > result.calibrator.balls.size();
  Advice advice{
      {"the calibrator is only partly in the field, or behind shutters or metal",
       "its balls are of another diameter than the file states, or the pixel size of the image is wrong",
       "the dose is too low, or the balls are too small in the image"},
      "open the overlay: orange circles are all candidates. Bring the whole calibrator into the field "
      "and acquire the view again"};
  if (many || has_figure(*result.failure, "fitting_pixel_mm") ||
      has_figure(*result.failure, "fitting_diameters"))
    std::swap(advice.causes[0], advice.causes[1]);
  return advice;
}

}  // namespace

Advice advice_for(const Result& result) {
  if (!result.failure) return {};
  switch (result.failure->reason) {
    case Reason::blank_image:
      return {{"the wrong frame of a multi-frame file", "X-rays were off", "the export lost the grey values"},
              "look at the image; choose another \"frame\" in case.json"};
    case Reason::saturated:
      return {{"the dose is too high", "the image was exported with its display window"},
              "export the image without a window, or reduce the dose"};
    case Reason::unequal_pixels:
      return {{"the image was exported for a screen of another format"},
              "export the image as the C-arm stored it, best as DICOM"};
    case Reason::plate_not_found:
    case Reason::plate_mismatch:
      return of_plate(result);
    case Reason::too_few_fiducials:
      return of_few(result);
    case Reason::ambiguous_labels:
      return of_ambiguous_labels(result);
    case Reason::calibrator_mismatch:
      return of_mismatch(result);
    case Reason::coplanar_fiducials:
      return {{"the calibrator is flat, or only a flat part of it is seen"}, "use a calibrator with depth"};
    case Reason::views_too_close:
      return {{"both views are from nearly the same direction", "one image was named twice"},
              "acquire the second view at about a right angle to the first"};
    case Reason::residual_too_large:
      return {
          {"the calibrator moved or was changed between the acquisitions",
           "calibrator.json deviates from the phantom", "the distortion map does not belong to this image"},
          "open the overlays and compare the residuals of the views; measure the calibrator again"};
    case Reason::ambiguous_handedness:
      return {{"the C-arm stores mirrored images", "calibrator.json is a mirror image of the phantom"},
              "state \"mirrored\": true for each view if the images are mirrored, else correct the sign of "
              "one axis "
              "in calibrator.json"};
    case Reason::scale_disagrees:
      return {{"the coordinates or the diameters in calibrator.json are in another unit or scale",
               "the pixel size of the images is wrong"},
              "measure a distance between two balls with a caliper and compare it with the file"};
    case Reason::patient_mismatch:
      return {{"images of two patients or studies are in the case"}, "choose images that belong together"};
    case Reason::uncertain:
      if (has_figure(*result.failure, "by_scale_sigma_mm"))
        return {{"the calibrator's size is known to its \"scale_sigma\" only", "a strict --max-error"},
                "measure a distance between two of its fiducials with a caliper, and the calibrator with "
                "`helicarm phantom measure --distance`"};
      return {{"few or badly placed fiducials", "views too close to each other", "a strict --max-error"},
              "`helicarm predict` shows where points are accurate; add a view or turn the second one"};
    default:
      return {};
  }
}

}  // namespace helicarm::pipeline
