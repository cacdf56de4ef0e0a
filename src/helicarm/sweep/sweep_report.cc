// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <limits>

#include <fmt/format.h>

#include "helicarm/report/chart.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/table.h"
#include "helicarm/sweep/sweep.h"

namespace helicarm::sweep {
namespace {

constexpr double shown_degrees = 180 / EIGEN_PI;

std::string card(const std::string& value, const std::string& what) {
  return fmt::format("<div class=\"card\"><b>{}</b><span>{}</span></div>", report::escaped(value), what);
}

std::string summary(const Sweep& sweep) {
  const auto accepted =
      std::ranges::count_if(sweep.frames, [](const auto& frame) { return frame.best.has_value(); });
  std::string html = fmt::format("<p class=\"state {0}\">{0}</p>", sweep.failure ? "refused" : "ok");
  if (sweep.failure)
    html += fmt::format("<p class=\"notice\">{}</p>", report::escaped(sweep.failure->message));
  html += "<div class=\"cards\">" +
          card(fmt::format("{} of {}", accepted, sweep.frames.size()), "images accepted");
  if (const auto& path = sweep.path) {
    html += card(fmt::format("{:.1f}°", path->arc_deg), "arc") +
            card(fmt::format("{:.1f} mm", path->source_to_axis_mm), "source to axis");
    if (path->source_to_detector_mm)
      html += card(fmt::format("{:.1f} mm", *path->source_to_detector_mm), "source to detector");
    html +=
        card(fmt::format("{:.2f} mm", path->isocentre_radius_mm), "farthest central ray from the isocentre");
    if (path->stiffness)
      html += card(fmt::format("{:.3f} / {:.3f} mm", path->stiffness->jitter[0], path->stiffness->jitter[1]),
                   "jitter of source / detector per image");
  }
  return html + "</div>\n";
}

/// A curve for each of three components over the angle, the frames' own places as dots.
report::Chart deviation_chart(const Sweep& sweep, const char* title, const char* unit, Eigen::Index first,
                              double scale) {
  report::Chart chart{title, "angle along the path, degrees", unit};
  constexpr std::array names{"u, to the right", "v, downwards", "w, to the detector"};
  for (Eigen::Index k = 0; k < 3; ++k) {
    report::ChartSeries curve{names[std::size_t(k)]}, dots{""};
    dots.scattered = true;
    for (const SweepFrame& frame : sweep.frames) {
      if (!frame.path_angle_deg || !frame.best) continue;
      const CameraVector& drawn = frame.flex ? *frame.flex : *frame.own;
      curve.points.push_back({*frame.path_angle_deg, scale * drawn[first + k]});
      if (frame.flex && frame.own)
        dots.points.push_back({*frame.path_angle_deg, scale * (*frame.own)[first + k]});
    }
    chart.series.push_back(std::move(curve));
  }
  return chart;
}

std::string charts(const Sweep& sweep) {
  if (!sweep.path) return "";
  return "<h2>Path and flex</h2>\n<figure class=\"plain\">" + report::chart_svg(path_charts(sweep)) +
         "<figcaption>Deviation from a camera that turns about the axis, in its own "
         "directions.</figcaption></figure>\n"
         "<h2>Images</h2>\n<figure class=\"plain\">" +
         report::chart_svg(image_charts(sweep)) + "</figure>\n";
}

std::string worst_frames(const Sweep& sweep) {
  constexpr std::size_t most = 12;
  std::vector<SweepFrame> frames;
  for (const SweepFrame& frame : sweep.frames)
    if (frame.best) frames.push_back(frame);
  std::ranges::sort(frames, std::greater<>(),
                    [](const SweepFrame& frame) { return frame.best->reprojection_rms_px; });
  if (frames.size() > most) frames.resize(most);
  const auto number = [](const char* title, const char* definition, auto value) {
    return report::ColumnOf<SweepFrame>{{title, definition, true},
                                        [value](const SweepFrame& f) { return report::Cell{value(f)}; }};
  };
  return html_of(report::table_of<SweepFrame>(
      "Accepted images with the largest residuals",
      {{{"Image", "View and frame"}, [](const SweepFrame& f) { return report::Cell{f.view}; }},
       number("Fiducials", "Fiducials used",
              [](const SweepFrame& f) { return std::to_string(f.fiducials_used); }),
       number("Residual, px", "Distance of the fiducials from their projections, rms",
              [](const SweepFrame& f) { return report::fixed(f.best->reprojection_rms_px, 3); }),
       number("Off the path",
              "Distance of the image's own camera from the path of the others, standard deviations",
              [](const SweepFrame& f) { return report::fixed(f.off_path_sigma, 1); })},
      frames));
}

std::string refused_frames(const Sweep& sweep) {
  std::vector<SweepFrame> frames;
  for (const SweepFrame& frame : sweep.frames)
    if (frame.failure) frames.push_back(frame);
  if (frames.empty()) return "";
  return html_of(report::table_of<SweepFrame>(
      "Refused images",
      {{{"Image", "View and frame"}, [](const SweepFrame& f) { return report::Cell{f.view}; }},
       {{"Code", "Code of the reason"},
        [](const SweepFrame& f) {
          return report::Cell{std::string(code(f.failure->reason)), true};
        }},
       {{"Reason", "Why the image is refused"},
        [](const SweepFrame& f) { return report::Cell{f.failure->message}; }}},
      frames));
}

std::string findings(const Sweep& sweep) {
  std::string html;
  for (const Warning& warning : sweep.warnings)
    html += fmt::format("<li><b>{}</b> {}</li>", code(warning.reason), report::escaped(warning.message));
  return html.empty() ? "" : "<h2>Warnings</h2>\n<ul>" + html + "</ul>\n";
}

}  // namespace

std::vector<report::Chart> path_charts(const Sweep& sweep) {
  if (!sweep.path) return {};
  return {deviation_chart(sweep, "Source from the reference orbit", "mm", 0, 1),
          deviation_chart(sweep, "Detector from the reference orbit", "mm", 3, 1),
          deviation_chart(sweep, "Turn of the detector", "degrees", 6, shown_degrees)};
}

std::vector<report::Chart> image_charts(const Sweep& sweep) {
  if (!sweep.path) return {};
  report::Chart residual{"Residuals", "image", "rms, px"}, sigma{"Source, standard deviation", "image", "mm"};
  report::ChartSeries rms{""}, off{""}, refused{"refused"};
  refused.scattered = true;
  for (const SweepFrame& frame : sweep.frames) {
    const double number = frame.number, none = std::numeric_limits<double>::quiet_NaN();
    rms.points.push_back({number, frame.best ? frame.best->reprojection_rms_px : none});
    off.points.push_back(
        {number, frame.best ? std::sqrt(calibration::source_covariance(*frame.best).trace()) : none});
    if (!frame.best) refused.points.push_back({number, 0});
  }
  residual.y_from_zero = sigma.y_from_zero = true;
  residual.series.push_back(std::move(rms));
  if (!refused.points.empty()) residual.series.push_back(std::move(refused));
  sigma.series.push_back(std::move(off));
  return {std::move(residual), std::move(sigma)};
}

std::string sweep_report(const Sweep& sweep) {
  return report::page_html("helicarm sweep", "Geometry of a run",
                           summary(sweep) + findings(sweep) + charts(sweep) +
                               (sweep.check ? check_html(*sweep.check) : std::string()) +
                               worst_frames(sweep) + refused_frames(sweep),
                           ". Millimetres, degrees and pixels.");
}

}  // namespace helicarm::sweep
