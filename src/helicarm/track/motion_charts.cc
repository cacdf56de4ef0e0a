// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/motion_charts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/report/markup.h"

namespace helicarm::track {
namespace {

constexpr double degrees = 180 / EIGEN_PI;
constexpr double no_number = std::numeric_limits<double>::quiet_NaN();

}  // namespace

report::Chart pose_chart(const std::vector<int>& numbers, const std::vector<TrackedBody>& frames,
                         std::string title, bool turns) {
  report::Chart chart{std::move(title), "frame", turns ? "degrees" : "mm"};
  constexpr std::array axes{"x", "y", "z"};
  Eigen::Vector3d start = Eigen::Vector3d::Zero();
  bool is_started = false;
  for (const TrackedBody& frame : frames)
    if (frame.pose && !is_started) start = frame.centre, is_started = true;
  for (int axis = 0; axis < 3; ++axis) {
    report::ChartSeries curve{axes[std::size_t(axis)]}, band{""};
    curve.joined = true;
    for (std::size_t f = 0; f < frames.size(); ++f) {
      const auto& pose = frames[f].pose;
      if (!pose) {
        curve.points.push_back({double(numbers[f]), no_number});
        curve.ranges.push_back({no_number, no_number});
        continue;
      }
      const double value = turns ? degrees * geometry::vector_from_rotation(pose->pose.rotation)[axis]
                                 : (frames[f].centre - start)[axis];
      const int at = axis + (turns ? 0 : 3);
      const double width =
          normal_at_975 * (turns ? degrees : 1) * std::sqrt(std::max(0.0, pose->covariance(at, at)));
      curve.points.push_back({double(numbers[f]), value});
      curve.ranges.push_back({value - width, value + width});
    }
    chart.series.push_back(std::move(curve));
  }
  return chart;
}

std::string report_card(const std::string& value, const std::string& what) {
  return fmt::format("<div class=\"card\"><b>{}</b><span>{}</span></div>", report::escaped(value), what);
}

std::string warnings_list(const std::vector<Warning>& warnings) {
  std::string html;
  for (const Warning& warning : warnings)
    html += fmt::format("<li><b>{}</b> {}{}</li>", code(warning.reason),
                        warning.view.empty() ? "" : report::escaped(warning.view) + ": ",
                        report::escaped(warning.message));
  return html.empty() ? "" : "<h2>Warnings</h2>\n<ul>" + html + "</ul>\n";
}

std::string motion_charts(const std::vector<int>& frames, const std::vector<std::string>& names,
                          const std::vector<BodySequence>& bodies,
                          const std::vector<std::vector<TrackedBody>>& relative,
                          const std::vector<report::Chart>& residuals,
                          const std::vector<std::vector<report::Chart>>& further) {
  std::string html;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    std::vector<report::Chart> charts{
        pose_chart(frames, bodies[b].smoothed, "Centre from its place in the first frame", false),
        pose_chart(frames, bodies[b].smoothed, "Rotation vector against the first frame", true),
        residuals[b]};
    if (b < further.size()) charts.insert(charts.end(), further[b].begin(), further[b].end());
    html += fmt::format(
        "<h2>{}</h2>\n<figure class=\"plain\">{}<figcaption>Smoothed; bars: 95 %.</figcaption></figure>\n",
        report::escaped(names[b]), report::chart_svg(charts));
  }
  for (std::size_t b = 0; b < relative.size(); ++b) {
    const std::array charts{pose_chart(frames, relative[b], "Centre in the reference body", false),
                            pose_chart(frames, relative[b], "Rotation vector in the reference body", true)};
    html += fmt::format("<h2>{} against {}</h2>\n<figure class=\"plain\">{}</figure>\n",
                        report::escaped(names[b + 1]), report::escaped(names[0]), report::chart_svg(charts));
  }
  return html;
}

}  // namespace helicarm::track
