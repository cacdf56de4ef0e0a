// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>

#include "helicarm/fiducials/status_words.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/tables.h"

namespace helicarm::report {
namespace {

struct ViewFiducial {
  const pipeline::ViewResult* view;
  const fiducials::Fiducial* fiducial;
  bool is_measured() const {
    return fiducial->status == fiducials::FiducialStatus::used ||
           fiducial->status == fiducials::FiducialStatus::rejected;
  }
};

Cell measured(const ViewFiducial& row, double value, int digits) {
  return {row.is_measured() ? fixed(value, digits) : "–"};
}

Cell status_of(const ViewFiducial& row) {
  std::string status(fiducials::word(row.fiducial->status));
  std::ranges::replace(status, '_', ' ');
  return {std::move(status), row.fiducial->status != fiducials::FiducialStatus::used};
}

Cell dots_of(const pipeline::ViewResult* view) {
  const rectification::Rectification& done = *view->rectification;
  if (done.dots_found == 0 && !done.dots_expected) return {"–"};
  return {done.dots_expected ? fmt::format("{} of {}", done.dots_found, *done.dots_expected)
                             : std::to_string(done.dots_found)};
}

/// A number of the map; nothing if the image is taken as free of distortion.
Cell of_map(const pipeline::ViewResult* view, double value, int digits) {
  return {view->rectification->map.is_identity() ? "–" : fixed(value, digits)};
}

}  // namespace

Table calibration_table(const std::vector<pipeline::ViewResult>& views) {
  using View = const pipeline::ViewResult*;
  std::vector<View> found;
  for (const pipeline::ViewResult& view : views)
    if (view.found) found.push_back(&view);
  const auto used = [](View v) {
    const auto count = std::ranges::count(v->found->fiducials, fiducials::FiducialStatus::used,
                                          &fiducials::Fiducial::status);
    return Cell{fmt::format("{} of {}", count, v->found->fiducials.size())};
  };
  return table_of<View>(
      "Calibration",
      {{words("View", "Name of the X-ray view"), [](View v) { return Cell{v->name}; }},
       {number("Fiducials", "Fiducials that the calibration uses, of all"), used},
       {number("Outliers", "Marks in the image that are no fiducial"),
        [](View v) { return Cell{std::to_string(v->found->false_blobs.size())}; }},
       {number("Residual rms, px",
               "Distance of the fiducials from their projections, root mean square, rectified px"),
        [](View v) { return v->calibrated ? Cell{fixed(v->calibrated->reprojection_rms_px, 3)} : Cell{}; }},
       {number("fx, px",
               "Distance of the source from the detector, in px along a row; negative in a mirrored image"),
        [](View v) { return v->calibrated ? Cell{fixed(v->calibrated->view.intrinsics.fx, 1)} : Cell{}; }},
       {words("Source x, y, z, mm", "Position of the X-ray source in the calibrator's frame, mm"),
        [](View v) {
          return v->calibrated ? Cell{coordinates(v->calibrated->view.source_in_world(), 1)} : Cell{};
        }}},
      found);
}

Table fiducials_table(const std::vector<pipeline::ViewResult>& views) {
  using Row = ViewFiducial;
  std::vector<Row> rows;
  for (const pipeline::ViewResult& view : views)
    if (view.found)
      for (const fiducials::Fiducial& each : view.found->fiducials) rows.push_back({&view, &each});
  return table_of<Row>(
      "Fiducials",
      {{words("Fiducial", "Label of the fiducial in the calibrator's file"),
        [](const Row& r) { return Cell{r.fiducial->label}; }},
       {words("View", "Name of the X-ray view"), [](const Row& r) { return Cell{r.view->name}; }},
       {words("Status",
              "used; rejected: its residual is too large; occluded, outside the image, or not found"),
        status_of},
       {number("Residual, px", "Distance of the centre's image from its projection, rectified px"),
        [](const Row& r) { return r.view->calibrated ? measured(r, r.fiducial->residual_px, 3) : Cell{}; }},
       {number("σ, px", "Standard deviation of the centre's image per axis, rectified px"),
        [](const Row& r) { return measured(r, r.fiducial->sigma_px, 3); }},
       {number("u, px", "Column of the centre's image, rectified px"),
        [](const Row& r) { return measured(r, r.fiducial->uv.x(), 2); }},
       {number("v, px", "Row of the centre's image, rectified px"),
        [](const Row& r) { return measured(r, r.fiducial->uv.y(), 2); }},
       {number("u raw, px", "Column of the centre in the image as acquired, px"),
        [](const Row& r) { return measured(r, r.fiducial->uv_raw.x(), 2); }},
       {number("v raw, px", "Row of the centre in the image as acquired, px"),
        [](const Row& r) { return measured(r, r.fiducial->uv_raw.y(), 2); }}},
      rows);
}

Table rectification_table(const std::vector<pipeline::ViewResult>& views) {
  using View = const pipeline::ViewResult*;
  std::vector<View> done;
  for (const pipeline::ViewResult& view : views)
    if (view.rectification) done.push_back(&view);
  return table_of<View>(
      "Rectification",
      {{words("View", "Name of the X-ray view"), [](View v) { return Cell{v->name}; }},
       {words("Model", "Distortion model; identity: the image is taken as free of distortion"),
        [](View v) { return Cell{v->rectification->map.model->name()}; }},
       {number("Dots",
               "Dots of the plate that were found in this image; none for a flat panel, a plate image or a "
               "given map"),
        dots_of},
       {number("Residual rms, px", "Distance of the dots from the corrected lattice, root mean square, px"),
        [](View v) { return of_map(v, v->rectification->map.residual_rms_px, 3); }},
       {number("Residual max, px", "The largest of these distances, px"),
        [](View v) { return of_map(v, v->rectification->map.residual_max_px, 3); }},
       {number("Held out rms, px",
               "The same for dots left out of the fit: the error to expect between the dots, px"),
        [](View v) { return of_map(v, v->rectification->map.held_out_rms_px, 3); }},
       {number(
            "Distortion mean, px",
            "Mean distance of the dots from an undistorted lattice, raw px; where the map is not by dots of "
            "this image over their field"),
        [](View v) { return of_map(v, v->rectification->raw_mean_px, 2); }},
       {number("Distortion max, px", "The largest of these distances, raw px"),
        [](View v) { return of_map(v, v->rectification->raw_max_px, 2); }}},
      done);
}

}  // namespace helicarm::report
