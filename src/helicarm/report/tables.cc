// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/tables.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/fiducials/status_words.h"
#include "helicarm/pipeline/outcome.h"
#include "helicarm/report/markup.h"

namespace helicarm::report {
namespace {

Column words(std::string title, std::string definition) {
  return {std::move(title), std::move(definition), false};
}
Column number(std::string title, std::string definition) {
  return {std::move(title), std::move(definition), true};
}

double error_95_of(const pipeline::PointResult& point) {
  return point.place ? localization::length_at_95(point.place->covariance_in_calibrator) : 0;
}

double largest_error_95(const std::vector<pipeline::PointResult>& points) {
  double largest = 0;
  for (const pipeline::PointResult& point : points) largest = std::max(largest, error_95_of(point));
  return largest;
}

ColumnOf<pipeline::PointResult> coordinate(const char* axis, Eigen::Index i) {
  return {number(fmt::format("{}, mm", axis), "Position in the calibrator's frame, mm"),
          [i](const pipeline::PointResult& p) {
            return Cell{p.place ? fixed(p.place->in_calibrator[i], 3) : "–"};
          }};
}

ColumnOf<pipeline::PointResult> sigma(const char* axis, Eigen::Index i) {
  return {number(fmt::format("σ {}, mm", axis), "Standard deviation of the position along the axis, mm"),
          [i](const pipeline::PointResult& p) {
            return Cell{p.place ? fixed(std::sqrt(std::max(p.place->covariance_in_calibrator(i, i), 0.0)), 3)
                                : "–"};
          }};
}

std::string warnings_of(const pipeline::PointResult& point) {
  std::string codes;
  for (const Warning& warning : point.warnings)
    codes += fmt::format("{}{}", codes.empty() ? "" : ", ", code(warning.reason));
  return codes;
}

struct NamedStatistics {
  std::string name;
  localization::Statistics value;
};

ColumnOf<NamedStatistics> statistic(const char* title, const char* definition,
                                    double localization::Statistics::*member) {
  return {number(title, definition),
          [member](const NamedStatistics& row) { return Cell{fixed(row.value.*member, 3)}; }};
}

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

struct StageTime {
  std::string stage;
  double ms;
};

}  // namespace

std::string message_of(const Failure& failure) {
  return fmt::format("{}{}{} ({})", failure.view, failure.view.empty() ? "" : ": ", failure.message,
                     code(failure.reason));
}

std::vector<KeyFigure> key_figures(const pipeline::Result& result) {
  const localization::Accuracy& accuracy = result.accuracy;
  std::vector<KeyFigure> figures;
  if (accuracy.fre_mm.n)
    figures.push_back({fixed(accuracy.fre_mm.mean, 3), "mm", "fiducial registration error, mean"});
  if (accuracy.tre_mm.n) {
    figures.push_back({fixed(accuracy.tre_mm.mean, 3), "mm", "target registration error, mean"});
    figures.push_back({fixed(accuracy.tre_mm.max, 3), "mm", "target registration error, largest"});
  }
  if (accuracy.fle_px.n)
    figures.push_back({fixed(accuracy.fle_px.rms, 3), "px", "fiducial localization error, rms"});
  if (const double largest = largest_error_95(result.points); largest > 0)
    figures.push_back({fixed(largest, 3), "mm", "largest predicted error of a point at 95 %"});
  return figures;
}

Table positions_table(const std::vector<pipeline::PointResult>& points) {
  using Point = pipeline::PointResult;
  const double largest = largest_error_95(points);
  const auto error = [largest](const Point& p) {
    return p.place ? Cell{fixed(error_95_of(p), 3), false, error_95_of(p) > 0 ? error_95_of(p) / largest : 0}
                   : Cell{};
  };
  const auto gap = [](const Point& p) {
    return p.place ? Cell{fixed(p.ray_gap_mm, 3), p.rays_miss} : Cell{};
  };
  const auto remark = [](const Point& p) {
    return p.reason ? Cell{message_of(*p.reason), true} : Cell{warnings_of(p)};
  };
  return table_of<Point>(
      "",
      {{number("±95 %, mm", "Length that 95 % of the position's errors do not exceed, mm"), error},
       {number("Ray gap, mm", "Largest distance between two of the point's rays, mm"), gap},
       coordinate("x", 0),
       coordinate("y", 1),
       coordinate("z", 2),
       sigma("x", 0),
       sigma("y", 1),
       sigma("z", 2),
       {words("Remark", "Why the point is not located, or what is doubtful"), remark}},
      points);
}

std::vector<ToolAtEnd> tools_at_ends(const std::vector<guidance::Verification>& lines) {
  std::vector<ToolAtEnd> tools;
  for (const guidance::Verification& line : lines) {
    for (const auto& [end, error] : {std::pair{"start", &line.start}, {"end", &line.end}})
      if (*error) tools.push_back({line.name, end, {}, {}, *error});
    if (line.depth) tools.push_back({line.name, "tip", {}, {}, {}, line.depth});
  }
  return tools;
}

Table statistics_table(const localization::Accuracy& accuracy) {
  std::vector<NamedStatistics> rows = {{"FLE of the fiducials, px", accuracy.fle_px},
                                       {"FRE of the fiducials (Eq. 11), mm", accuracy.fre_mm},
                                       {"TRE of the check targets (Eq. 12), mm", accuracy.tre_mm}};
  std::erase_if(rows, [](const NamedStatistics& row) { return row.value.n == 0; });
  using S = localization::Statistics;
  return table_of<NamedStatistics>(
      "Accuracy",
      {{words("Error", "Fiducial localization, fiducial registration and target registration error"),
        [](const NamedStatistics& row) { return Cell{row.name}; }},
       statistic("Mean", "Mean of the errors", &S::mean),
       statistic("RMS", "Root mean square of the errors", &S::rms),
       statistic("Max", "Largest error", &S::max),
       statistic("Min", "Smallest error", &S::min),
       {number("n", "Number of errors"),
        [](const NamedStatistics& row) { return Cell{std::to_string(row.value.n)}; }}},
      rows);
}

Table targets_table(const localization::Accuracy& accuracy) {
  using Target = localization::TargetError;
  return table_of<Target>(
      "Check targets",
      {{words("Target", "Name of the check target"), [](const Target& t) { return Cell{t.name}; }},
       {number("Error, mm", "Distance from the target's true position (Eq. 12), mm"),
        [](const Target& t) { return Cell{fixed(t.error_mm, 3)}; }},
       {number("Predicted rms, mm", "Root mean square of that error by the covariance, mm"),
        [](const Target& t) { return Cell{fixed(t.predicted_mm, 3)}; }},
       {number("Predicted at 95 %, mm", "Length that 95 % of such errors do not exceed, mm"),
        [](const Target& t) { return Cell{fixed(t.predicted_95_mm, 3)}; }}},
      accuracy.targets);
}

Table points_table(const std::vector<pipeline::PointResult>& points) {
  using Point = pipeline::PointResult;
  return beside(
      table_of<Point>(
          "Points in the calibrator's frame",
          {{words("Point", "Name of the point"), [](const Point& p) { return Cell{p.name}; }},
           {words("Kind", "pick: marked by a person; target: a ball or wire that the program finds"),
            [](const Point& p) { return Cell{std::string(word(p.source))}; }}},
          points),
      positions_table(points));
}

namespace {

/// A tunnel of picks or of a model's plan.
struct TunnelRow {
  const guidance::Tunnel* tunnel;
  std::string model;  ///< empty: of picks
  std::optional<double> start_error_mm, end_error_mm;
};

std::vector<TunnelRow> tunnel_rows(const pipeline::Result& result) {
  std::vector<TunnelRow> rows;
  for (const guidance::Tunnel& tunnel : result.tunnels)
    rows.push_back({&tunnel,
                    {},
                    pipeline::tunnel_end_error_in_tool(result, tunnel.name, true),
                    pipeline::tunnel_end_error_in_tool(result, tunnel.name, false)});
  const auto error = [&](std::size_t end) {
    const auto& in_tool = result.model_points[end].place.in_tool;
    return in_tool ? std::optional(localization::length_at_95(in_tool->covariance)) : std::nullopt;
  };
  for (const pipeline::ModelTunnel& planned : result.model_tunnels)
    rows.push_back({&planned.tunnel, planned.model, error(planned.ends.start), error(planned.ends.end)});
  return rows;
}

}  // namespace

Table tunnels_table(const pipeline::Result& result) {
  using Row = TunnelRow;
  constexpr const char* bound = "Length that 95 % of the errors of that end do not exceed, mm";
  return table_of<Row>(
      "Tunnels in the tool's frame",
      {{words("Tunnel", "Name of the tunnel"), [](const Row& r) { return Cell{r.tunnel->name}; }},
       {words("Model", "Registered model whose plan names the tunnel; empty: its ends are picked"),
        [](const Row& r) { return Cell{r.model}; }},
       {words("Start x, y, z, mm", "Start of the tunnel in the tool's frame, mm"),
        [](const Row& r) { return Cell{coordinates(r.tunnel->start_in_tool, 2)}; }},
       {number("±95 %, mm", bound), [](const Row& r) { return Cell{fixed(r.start_error_mm, 3)}; }},
       {words("End x, y, z, mm", "End of the tunnel in the tool's frame, mm"),
        [](const Row& r) { return Cell{coordinates(r.tunnel->end_in_tool, 2)}; }},
       {number("±95 %, mm", bound), [](const Row& r) { return Cell{fixed(r.end_error_mm, 3)}; }},
       {words("Axis", "Unit vector from start to end in the tool's frame"),
        [](const Row& r) { return Cell{coordinates(r.tunnel->axis_in_tool, 4)}; }},
       {number("Axis σ, °", "Standard deviation of the axis' direction, degrees"),
        [](const Row& r) { return Cell{fixed(r.tunnel->axis_sigma_deg(), 3)}; }},
       {number("Length, mm", "Distance from start to end, mm"),
        [](const Row& r) { return Cell{fixed(r.tunnel->length_mm, 2)}; }}},
      tunnel_rows(result));
}

Table bone_table(const std::vector<TunnelInBoneRow>& tunnels) {
  using Row = TunnelInBoneRow;
  const auto figure = [](std::optional<double> guidance::BoneCheck::*member, int digits) {
    return [=](const Row& r) { return Cell{fixed(r.check.*member, digits)}; };
  };
  using guidance::BoneCheck;
  return table_of<Row>(
      "Tunnels in the bone",
      {{words("Tunnel", "Name of the tunnel"), [](const Row& r) { return Cell{r.tunnel}; }},
       {words("Model", "Registered model whose plan names the tunnel"),
        [](const Row& r) { return Cell{r.model}; }},
       {number("Diameter, mm", "Diameter of the tunnel, mm"), figure(&BoneCheck::diameter_mm, 1)},
       {number("Bridge, mm",
               "Least distance of the tunnel's wall from the bone's surface, mm; negative: outside the bone"),
        [](const Row& r) {
          return Cell{fixed(r.check.bridge_mm, 2), r.check.is_breach() || r.check.is_thin()};
        }},
       {number("σ, mm", "Standard deviation of the bridge as drilled, with the registration, mm"),
        figure(&BoneCheck::drilled_sigma_mm, 2)},
       {number("At, mm", "Depth of that place behind the entry, mm"), figure(&BoneCheck::at_mm, 1)},
       {number("In bone, mm", "Length of the axis in the bone, mm"),
        [](const Row& r) { return Cell{fixed(r.check.length_in_bone_mm, 1)}; }},
       {number("Entry, °", "Angle between axis and bone surface at the entry, degrees"),
        figure(&BoneCheck::entry_angle_deg, 0)},
       {number("Exit, °", "Angle between axis and bone surface at the exit, degrees"),
        figure(&BoneCheck::exit_angle_deg, 0)},
       {number("Ahead, mm", "Bone ahead of a blind tunnel's end, mm"), figure(&BoneCheck::end_mm, 2)}},
      tunnels);
}

Table bone_table(const pipeline::Result& result) {
  std::vector<TunnelInBoneRow> rows;
  for (const pipeline::ModelTunnel& planned : result.model_tunnels)
    if (planned.bone_check) rows.push_back({planned.tunnel.name, planned.model, *planned.bone_check});
  return bone_table(rows);
}

Table verification_table(const std::vector<ToolAtEnd>& tools) {
  const auto in_images = [](double guidance::LineError::*member) {
    return [member](const ToolAtEnd& t) {
      return t.in_images ? Cell{fixed((*t.in_images).*member, 2)} : Cell{};
    };
  };
  using guidance::LineError;
  return table_of<ToolAtEnd>(
      "Verification",
      {{words("Tunnel", "Name of the tunnel"), [](const ToolAtEnd& t) { return Cell{t.tunnel}; }},
       {words("End", "Start or end of the tunnel; tip: of a drill held by hand"),
        [](const ToolAtEnd& t) { return Cell{t.end}; }},
       {number("Error, mm", "Distance of the end from the tool's axis by tracker and X-ray images, mm"),
        [](const ToolAtEnd& t) { return Cell{fixed(t.distance_mm, 2)}; }},
       {number("Predicted rms, mm", "Root mean square of that distance by the covariances, mm"),
        [](const ToolAtEnd& t) { return Cell{fixed(t.predicted_mm, 2)}; }},
       {number("Eq. 17, px", "Distance in the X-ray images, all views combined (Eq. 17), px"),
        in_images(&LineError::combined_px)},
       {number("Eq. 17, mm", "The same, converted to mm at the depth of the end"),
        in_images(&LineError::combined_mm)},
       {number("In space, mm", "Distance of the end from the tool's axis by the X-ray images alone, mm"),
        in_images(&LineError::distance_mm)},
       {number(
            "Beyond end, mm",
            "Of the drill's tip along the tunnel, negative before the planned end, with its 95 % error, mm"),
        [](const ToolAtEnd& t) {
          if (!t.depth) return Cell{};
          return Cell{fmt::format("{:+.2f} ± {:.2f}", t.depth->beyond_end_mm, t.depth->error_95_mm()),
                      t.depth->why_off(t.tunnel).has_value()};
        }}},
      tools);
}

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

Table timing_table(const pipeline::Timing& timing) {
  std::vector<StageTime> rows;
  for (const auto& [stage, time] : {std::pair{"read", timing.read},
                                    {"rectify", timing.rectify},
                                    {"detect", timing.detect},
                                    {"label", timing.label},
                                    {"calibrate", timing.calibrate},
                                    {"locate", timing.locate},
                                    {"total", timing.total}})
    if (time) rows.push_back({stage, *time});
  return table_of<StageTime>(
      "Time",
      {{words("Stage", "Stage of the measurement"), [](const StageTime& row) { return Cell{row.stage}; }},
       {number("Time, ms", "Wall-clock time, ms"),
        [](const StageTime& row) { return Cell{fixed(row.ms, 1)}; }}},
      rows);
}

std::vector<Table> tables_of(const pipeline::Result& result) {
  std::vector<Table> tables;
  for (const Table& table :
       {statistics_table(result.accuracy), targets_table(result.accuracy), points_table(result.points),
        tunnels_table(result), bone_table(result), verification_table(tools_at_ends(result.verifications)),
        calibration_table(result.views), fiducials_table(result.views), rectification_table(result.views),
        timing_table(result.timing_ms)})
    if (!table.rows.empty()) tables.push_back(without_empty_columns(table));
  return tables;
}

}  // namespace helicarm::report
