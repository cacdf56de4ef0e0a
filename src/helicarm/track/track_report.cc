// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/report/chart.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/table.h"
#include "helicarm/track/motion_charts.h"
#include "helicarm/track/track.h"

namespace helicarm::track {
namespace {

constexpr double no_value = std::numeric_limits<double>::quiet_NaN();

/// Of each body, how far the mean of its markers' Butterworth-filtered places, where all have one, is from
/// its smooth centre; empty without a filter.
std::vector<std::vector<report::Chart>> filter_charts(const Sequence& sequence, const TrackCase& the_case) {
  const auto places = butterworth_places(sequence, the_case);
  std::vector<std::vector<report::Chart>> charts;
  if (places.empty()) return charts;
  for (std::size_t b = 0; b < the_case.bodies.size(); ++b) {
    const auto& markers = the_case.bodies[b].markers;
    report::Chart chart{fmt::format("Centre by Butterworth at {:g} Hz, less the smooth one",
                                    the_case.butterworth->cut_off_hz),
                        "frame", "mm"};
    for (int axis = 0; axis < 3; ++axis) {
      report::ChartSeries curve{std::string(1, "xyz"[axis])};
      for (std::size_t f = 0; f < sequence.frames.size(); ++f) {
        const TrackedBody& smooth = sequence.bodies[b].smoothed[f];
        double sum = smooth.pose ? 0 : no_value;
        for (const std::size_t marker : markers)
          sum += places[marker][f] ? (*places[marker][f])[axis] - smooth.centre[axis] : no_value;
        curve.points.push_back({double(sequence.frames[f]), sum / double(markers.size())});
      }
      chart.series.push_back(std::move(curve));
    }
    charts.push_back({std::move(chart)});
  }
  return charts;
}

report::Chart misfit_chart(const Sequence& sequence, std::size_t body) {
  report::Chart rms{"Markers from their places in the body", "frame", "rms, mm"};
  report::ChartSeries residual{""};
  for (std::size_t f = 0; f < sequence.frames.size(); ++f)
    residual.points.push_back(
        {double(sequence.frames[f]), sequence.bodies[body].frames[f].rms_mm.value_or(no_value)});
  rms.series.push_back(std::move(residual));
  rms.y_from_zero = true;
  return rms;
}

std::string body_charts(const Sequence& sequence, const TrackCase& the_case) {
  std::vector<std::string> names;
  std::vector<report::Chart> residuals;
  for (std::size_t b = 0; b < the_case.bodies.size(); ++b) {
    names.push_back(the_case.bodies[b].name);
    residuals.push_back(misfit_chart(sequence, b));
  }
  return motion_charts(sequence.frames, names, sequence.bodies, sequence.relative, residuals,
                       filter_charts(sequence, the_case));
}

/// Nothing where the bodies have no origins.
std::optional<report::Chart> shift_chart(const Sequence& sequence, const Joint& joint) {
  constexpr std::array names{"lateral", "anterior", "distraction"};
  report::Chart chart{"Joint translations (Grood and Suntay)", "frame", "mm"};
  bool is_any = false;
  for (int i = 0; i < 3; ++i) {
    report::ChartSeries curve{names[std::size_t(i)]};
    curve.joined = true;
    for (std::size_t f = 0; f < sequence.frames.size(); ++f) {
      const auto& at = joint.frames[f];
      const bool is_here = at && at->shift;
      is_any = is_any || is_here;
      const double value = is_here ? (*at->shift)[i] : no_value;
      const double width = is_here ? normal_at_975 * std::sqrt(at->shift_covariance(i, i)) : no_value;
      curve.points.push_back({double(sequence.frames[f]), value});
      curve.ranges.push_back({value - width, value + width});
    }
    chart.series.push_back(std::move(curve));
  }
  return is_any ? std::optional(std::move(chart)) : std::nullopt;
}

std::vector<report::Chart> charts_of_joint(const Sequence& sequence, const Joint& joint) {
  constexpr double to_degrees = 180 / EIGEN_PI;
  constexpr std::array names{"flexion", "adduction", "external rotation"};
  report::Chart chart{"Joint angles (Grood and Suntay)", "frame", "degrees"};
  for (int i = 0; i < 3; ++i) {
    report::ChartSeries curve{names[std::size_t(i)]};
    curve.joined = true;
    for (std::size_t f = 0; f < sequence.frames.size(); ++f) {
      const auto& at = joint.frames[f];
      const double value = at ? to_degrees * at->angles[i] : no_value;
      const double width = at ? normal_at_975 * to_degrees * std::sqrt(at->covariance(i, i)) : no_value;
      curve.points.push_back({double(sequence.frames[f]), value});
      curve.ranges.push_back({value - width, value + width});
    }
    chart.series.push_back(std::move(curve));
  }
  std::vector<report::Chart> charts{std::move(chart)};
  if (auto shifts = shift_chart(sequence, joint)) charts.push_back(std::move(*shifts));
  return charts;
}

std::string joint_charts(const Sequence& sequence, const TrackCase& the_case) {
  std::string html;
  for (const Joint& joint : sequence.joints) {
    const auto charts = charts_of_joint(sequence, joint);
    html += fmt::format(
        "<h2>Joint of {} and {}</h2>\n<figure class=\"plain\">{}<figcaption>Smoothed; bars: 95 %, of "
        "the poses.</figcaption></figure>\n",
        report::escaped(the_case.bodies[joint.reference].name),
        report::escaped(the_case.bodies[joint.body].name), report::chart_svg(charts));
  }
  return html;
}

std::string gap_chart(const Sequence& sequence, const TrackCase& the_case) {
  report::Chart chart{"Ray gaps", "frame", "mm"};
  chart.y_from_zero = true;
  constexpr std::size_t most_named = 12;
  for (std::size_t m = 0; m < the_case.markers.size(); ++m) {
    report::ChartSeries dots{the_case.markers.size() <= most_named ? the_case.markers[m] : ""};
    dots.scattered = true;
    for (std::size_t f = 0; f < sequence.frames.size(); ++f)
      if (const auto& gap = sequence.markers[f][m].ray_gap_mm)
        dots.points.push_back({double(sequence.frames[f]), *gap});
    if (!dots.points.empty()) chart.series.push_back(std::move(dots));
  }
  if (chart.series.empty()) return "";
  return "<figure class=\"plain\">" + report::chart_svg({&chart, 1}) + "</figure>\n";
}

std::string marker_table(const Sequence& sequence, const TrackCase& the_case) {
  struct Row {
    std::string name;
    std::array<int, 4> counts{};
    double sigma = 0;
    int placed = 0;
  };
  std::vector<Row> rows;
  for (std::size_t m = 0; m < the_case.markers.size(); ++m) {
    Row row{the_case.markers[m]};
    for (const auto& frame : sequence.markers) {
      ++row.counts[std::size_t(frame[m].status)];
      if (frame[m].status == MarkerStatus::tracked)
        row.sigma += frame[m].place->covariance.trace(), ++row.placed;
    }
    rows.push_back(row);
  }
  const auto count = [](const char* title, const char* what, std::size_t i) {
    return report::ColumnOf<Row>{
        {title, what, true}, [i](const Row& row) {
          return report::Cell{std::to_string(row.counts[i]), i == 3 && row.counts[i] > 0};
        }};
  };
  return html_of(report::table_of<Row>(
      "Markers",
      {{{"Marker", "Name of the pick"}, [](const Row& row) { return report::Cell{row.name}; }},
       count("Tracked", "Frames in which two views or more show it", 0),
       count("One view", "Frames in which one view shows it: placed with its body's help", 1),
       count("Predicted", "Frames in which no view shows it", 2),
       count("Lost", "Frames without a place", 3),
       {{"Sigma, mm", "Standard deviation of a tracked place, rms over the axes", true},
        [](const Row& row) {
          return report::Cell{report::fixed(
              row.placed ? std::optional(std::sqrt(row.sigma / (3 * row.placed))) : std::nullopt, 4)};
        }}},
      rows));
}

std::string distance_table(const Sequence& sequence, const TrackCase& the_case) {
  if (sequence.distances.empty()) return "";
  return html_of(report::table_of<MarkerDistance>(
      "Distances between markers of a body",
      {{{"Markers", "Names"},
        [&](const MarkerDistance& d) {
          return report::Cell{the_case.markers[d.first] + " – " + the_case.markers[d.second]};
        }},
       {{"Mean, mm", "Over the frames in which both are tracked", true},
        [](const MarkerDistance& d) { return report::Cell{report::fixed(d.mean_mm, 3)}; }},
       {{"Standard deviation, mm", "The precision that marker-based studies report", true},
        [](const MarkerDistance& d) { return report::Cell{report::fixed(d.deviation_mm, 4)}; }},
       {{"Frames", "Number", true},
        [](const MarkerDistance& d) { return report::Cell{std::to_string(d.frames)}; }}},
      sequence.distances));
}

}  // namespace

std::vector<CurveSheet> curve_sheets(const Sequence& sequence, const TrackCase& the_case) {
  std::vector<CurveSheet> sheets;
  for (std::size_t b = 0; b < sequence.bodies.size(); ++b) {
    const auto& smooth = sequence.bodies[b].smoothed;
    sheets.push_back({the_case.bodies[b].name,
                      {pose_chart(sequence.frames, smooth, "Centre from its place in the first frame", false),
                       pose_chart(sequence.frames, smooth, "Rotation vector against the first frame", true),
                       misfit_chart(sequence, b)}});
  }
  for (std::size_t b = 0; b < sequence.relative.size(); ++b)
    sheets.push_back(
        {the_case.bodies[b + 1].name + " / " + the_case.bodies[0].name,
         {pose_chart(sequence.frames, sequence.relative[b], "Centre in the reference body", false),
          pose_chart(sequence.frames, sequence.relative[b], "Rotation vector in the reference body", true)}});
  for (const Joint& joint : sequence.joints)
    sheets.push_back({the_case.bodies[joint.body].name + " / " + the_case.bodies[joint.reference].name,
                      charts_of_joint(sequence, joint)});
  return sheets;
}

std::string track_report(const Sequence& sequence, const TrackCase& the_case) {
  std::array<int, 4> counts{};
  for (const auto& frame : sequence.markers)
    for (const TrackedMarker& marker : frame) ++counts[std::size_t(marker.status)];
  const int all = counts[0] + counts[1] + counts[2] + counts[3];
  std::string cards =
      "<div class=\"cards\">" +
      report_card(fmt::format("{} of {}", sequence.complete, sequence.frames.size()),
                  "frames with all markers tracked") +
      report_card(fmt::format("{:.1f} %", 100.0 * counts[0] / std::max(1, all)), "of the places tracked") +
      report_card(std::to_string(sequence.repaired), "exchanges repaired");
  for (std::size_t k = 1; k < the_case.views.size(); ++k)
    if (sequence.delays[k].is_known)
      cards += report_card(fmt::format("{:.4f} frames", sequence.delays[k].frames),
                           "delay of " + report::escaped(the_case.views[k].images.name));
  return report::page_html("helicarm track", "Markers and bodies through a sequence",
                           cards + "</div>\n" + warnings_list(sequence.warnings) +
                               body_charts(sequence, the_case) + joint_charts(sequence, the_case) +
                               "<h2>Markers</h2>\n" + gap_chart(sequence, the_case) +
                               marker_table(sequence, the_case) + distance_table(sequence, the_case),
                           ". Millimetres, degrees and pixels.");
}

}  // namespace helicarm::track
