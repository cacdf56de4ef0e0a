// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/sections.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "helicarm/pipeline/advice.h"
#include "helicarm/pipeline/outcome.h"
#include "helicarm/report/figures.h"
#include "helicarm/report/markup.h"

namespace helicarm::report {
namespace {

std::string headed(std::string_view heading, const std::string& content) {
  return content.empty() ? std::string{}
                         : fmt::format("<section><h2>{}</h2>\n{}</section>\n", heading, content);
}

std::string card(const std::string& value, std::string_view unit, std::string_view what) {
  return fmt::format("<div class=\"card\"><b>{} <small>{}</small></b><span>{}</span></div>\n", value, unit,
                     what);
}

std::string coordinates(const std::optional<Eigen::Vector3d>& point) {
  return point ? fmt::format("{:.2f}, {:.2f}, {:.2f}", point->x(), point->y(), point->z()) : std::string("–");
}

std::string message_of(const Failure& failure) {
  const std::string view = failure.view.empty() ? std::string{} : escaped(failure.view) + ": ";
  return fmt::format("{}{} <span class=\"soft\">({})</span>", view, escaped(failure.message),
                     code(failure.reason));
}

double largest_error_95(const pipeline::Result& result) {
  double largest = 0;
  for (const pipeline::PointResult& point : result.points)
    if (point.place)
      largest = std::max(largest, localization::length_at_95(point.place->covariance_in_calibrator));
  return largest;
}

/// A bar proportional to the error, relative to the largest.
std::string error_bar(double error, double largest) {
  return fmt::format("<span class=\"error\" style=\"width:{:.2f}rem\"></span>",
                     largest > 0 ? 8 * error / largest : 0);
}

std::string status_cell(const fiducials::Fiducial& fiducial) {
  constexpr std::array words = {"used", "occluded", "outside", "rejected", "not found"};
  const char* word = words[static_cast<std::size_t>(fiducial.status)];
  return fiducial.status == fiducials::FiducialStatus::used
             ? word
             : fmt::format("<span class=\"bad\">{}</span>", word);
}

void statistics_row(HtmlTable& table, std::string_view what, const localization::Statistics& s) {
  if (s.n > 0)
    table.row({std::string(what), fixed(s.mean, 3), fixed(s.rms, 3), fixed(s.max, 3), fixed(s.min, 3),
               std::to_string(s.n)});
}

/// Likely causes in order, and the next step.
std::string advice_of(const pipeline::Result& result) {
  const pipeline::Advice advice = pipeline::advice_for(result);
  if (advice.causes.empty()) return {};
  std::string html = "<p>Likely causes, in order:</p>\n<ol class=\"causes\">\n";
  for (const std::string& cause : advice.causes) html += "<li>" + escaped(cause) + "</li>\n";
  return html + "</ol>\n<p><b>Next:</b> " + escaped(advice.next) + ".</p>\n";
}

}  // namespace

std::string summary_section(const pipeline::Result& result) {
  std::string html;
  if (result.failure)
    html +=
        fmt::format("<p><span class=\"state refused\">refused</span> {}</p>\n", message_of(*result.failure)) +
        advice_of(result);
  else
    html += "<p><span class=\"state ok\">measured</span></p>\n";
  const localization::Accuracy& accuracy = result.accuracy;
  std::string cards;
  if (accuracy.fre_mm.n)
    cards += card(fixed(accuracy.fre_mm.mean, 3), "mm", "fiducial registration error, mean");
  if (accuracy.tre_mm.n) {
    cards += card(fixed(accuracy.tre_mm.mean, 3), "mm", "target registration error, mean");
    cards += card(fixed(accuracy.tre_mm.max, 3), "mm", "target registration error, largest");
  }
  if (accuracy.fle_px.n)
    cards += card(fixed(accuracy.fle_px.rms, 3), "px", "fiducial localization error, rms");
  if (const double largest = largest_error_95(result); largest > 0)
    cards += card(fixed(largest, 3), "mm", "largest predicted error of a point at 95 %");
  if (!cards.empty()) html += "<div class=\"cards\">\n" + cards + "</div>\n";
  return html;
}

std::string views_section(const pipeline::Result& result) {
  std::string html;
  for (std::size_t i = 0; i < result.views.size(); ++i) {
    const pipeline::ViewResult& view = result.views[i];
    const std::string figure = view_figure(result, i);
    if (figure.empty()) continue;
    std::string caption = "<b>" + escaped(view.name) + "</b>";
    if (view.calibrated)
      caption += fmt::format(", reprojection error {:.3f} px rms", view.calibrated->reprojection_rms_px);
    if (view.found && view.found->mirrored) caption += ", stored mirrored";
    html += fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n", figure, caption);
  }
  if (html.empty()) return {};
  return headed("Rectified X-ray images",
                "<div class=\"views\">\n" + html +
                    "</div>\n<p class=\"soft\">Green: used fiducials, with their residuals as orange arrows. "
                    "Red crosses: outliers. Orange circles and labels with a question mark: "
                    "candidates and best guess of a refused view. Blue: plate. Violet: points. Yellow: "
                    "planned tunnels. Red lines: "
                    "tool.</p>\n");
}

std::string points_section(const pipeline::Result& result) {
  HtmlTable table({"Point", "Kind", "In calibrator, mm", "#&#963; x", "#&#963; y", "#&#963; z",
                   "#Error at 95 %, mm", "", "#Ray gap, mm"});
  const double largest = largest_error_95(result);
  for (const pipeline::PointResult& point : result.points) {
    const std::string kind = point.source == localization::PointSource::pick ? "pick" : "target";
    if (!point.place) {
      const std::string why = point.reason ? message_of(*point.reason) : std::string("–");
      table.row(
          {escaped(point.name), kind, "<span class=\"bad\">" + why + "</span>", "–", "–", "–", "–", "", "–"});
      continue;
    }
    const Eigen::Matrix3d& covariance = point.place->covariance_in_calibrator;
    const Eigen::Vector3d sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
    const double error = localization::length_at_95(covariance);
    const std::string gap = fixed(point.ray_gap_mm, 3);
    table.row({escaped(point.name), kind, coordinates(point.place->in_calibrator), fixed(sigma.x(), 3),
               fixed(sigma.y(), 3), fixed(sigma.z(), 3), fixed(error, 3), error_bar(error, largest),
               point.rays_miss ? "<span class=\"bad\">" + gap + "</span>" : gap});
  }
  return table.empty() ? std::string{} : headed("Points", table.html());
}

std::string accuracy_section(const pipeline::Result& result) {
  const localization::Accuracy& accuracy = result.accuracy;
  HtmlTable table({"Error, mm", "#Mean", "#RMS", "#Max", "#Min", "#n"});
  statistics_row(table, "FRE of the fiducials (Eq. 11)", accuracy.fre_mm);
  statistics_row(table, "TRE of the check targets (Eq. 12)", accuracy.tre_mm);
  if (table.empty()) return {};
  std::string html = table.html();
  HtmlTable targets({"Target", "#Error, mm", "#Predicted rms, mm", "#Predicted at 95 %, mm"});
  for (const localization::TargetError& target : accuracy.targets)
    targets.row({escaped(target.name), fixed(target.error_mm, 3), fixed(target.predicted_mm, 3),
                 fixed(target.predicted_95_mm, 3)});
  if (!targets.empty()) html += targets.html();
  return headed("Accuracy", html);
}

std::string guidance_section(const pipeline::Result& result) {
  std::string html;
  HtmlTable tunnels({"Tunnel", "Start in tool, mm", "#95 %, mm", "End in tool, mm", "#95 %, mm",
                     "Axis in tool", "#Axis ±, °", "#Length, mm"});
  for (const guidance::Tunnel& tunnel : result.tunnels)
    tunnels.row({escaped(tunnel.name), coordinates(tunnel.start_in_tool),
                 fixed(pipeline::tunnel_end_error_in_tool(result, tunnel.name, true), 3),
                 coordinates(tunnel.end_in_tool),
                 fixed(pipeline::tunnel_end_error_in_tool(result, tunnel.name, false), 3),
                 tunnel.axis_in_tool ? fmt::format("{:.4f}, {:.4f}, {:.4f}", tunnel.axis_in_tool->x(),
                                                   tunnel.axis_in_tool->y(), tunnel.axis_in_tool->z())
                                     : std::string("–"),
                 fixed(tunnel.axis_sigma_deg(), 3), fixed(tunnel.length_mm, 2)});
  if (!tunnels.empty()) html += headed("Tunnels", tunnels.html());
  HtmlTable lines({"Tool line", "End", "#Eq. 17, px", "#Eq. 17, mm", "#In space, mm"});
  for (const verification::Verification& verification : result.verifications)
    for (const auto& [end, error] : {std::pair{"start", &verification.start}, {"end", &verification.end}})
      if (*error)
        lines.row({escaped(verification.name), end, fixed((*error)->combined_px, 2),
                   fixed((*error)->combined_mm, 2), fixed((*error)->distance_mm, 2)});
  if (!lines.empty()) html += headed("Verification", lines.html());
  return html;
}

std::string fiducials_section(const pipeline::Result& result) {
  std::string html;
  for (const pipeline::ViewResult& view : result.views) {
    if (!view.found) continue;
    HtmlTable table({"Fiducial", "Status", "#u raw", "#v raw", "#u", "#v", "#&#963;, px", "#Residual, px"});
    for (const fiducials::Fiducial& fiducial : view.found->fiducials) {
      const bool seen = fiducial.status == fiducials::FiducialStatus::used ||
                        fiducial.status == fiducials::FiducialStatus::rejected;
      const auto if_seen = [&](double value, int digits) {
        return seen ? fixed(value, digits) : std::string("–");
      };
      table.row({escaped(fiducial.label), status_cell(fiducial), if_seen(fiducial.uv_raw.x(), 2),
                 if_seen(fiducial.uv_raw.y(), 2), if_seen(fiducial.uv.x(), 2), if_seen(fiducial.uv.y(), 2),
                 if_seen(fiducial.sigma_px, 3), if_seen(fiducial.residual_px, 3)});
    }
    html += fmt::format("<div><h3>{}</h3>{}<p class=\"soft\">{} outliers</p></div>\n", escaped(view.name),
                        table.html(), view.found->false_blobs.size());
  }
  return html.empty() ? html : headed("Fiducials", "<div class=\"views\">" + html + "</div>");
}

std::string rectification_section(const pipeline::Result& result) {
  HtmlTable table({"View", "Model", "#Dots", "#Residual rms, px", "#Largest, px", "#Held out rms, px",
                   "#Distortion mean, px", "#Largest, px"});
  std::string figures;
  for (const pipeline::ViewResult& view : result.views) {
    if (!view.rectification || view.rectification->map.is_identity()) continue;
    const rectification::Rectification& r = *view.rectification;
    table.row({escaped(view.name), escaped(r.map.model->name()),
               r.dots_expected ? fmt::format("{} of {}", r.dots_found, *r.dots_expected)
                               : std::to_string(r.dots_found),
               fixed(r.map.residual_rms_px, 3), fixed(r.map.residual_max_px, 3),
               fixed(r.map.held_out_rms_px, 3), fixed(r.raw_mean_px, 2), fixed(r.raw_max_px, 2)});
    if (const std::string figure = distortion_figure(view); !figure.empty())
      figures += fmt::format(
          "<figure class=\"plain\">{}<figcaption>Distortion in {}: displacement from rectified to raw "
          "position.</figcaption></figure>\n",
          figure, escaped(view.name));
  }
  if (table.empty()) return {};
  return headed("Rectification", table.html() + "<div class=\"views\">\n" + figures + "</div>\n");
}

std::string timing_section(const pipeline::Result& result) {
  HtmlTable table({"Stage", "#Time, ms"});
  const pipeline::Timing& t = result.timing_ms;
  for (const auto& [stage, time] : {std::pair{"read", t.read},
                                    {"rectify", t.rectify},
                                    {"detect", t.detect},
                                    {"label", t.label},
                                    {"calibrate", t.calibrate},
                                    {"locate", t.locate},
                                    {"total", t.total}})
    if (time) table.row({stage, fixed(time, 1)});
  return table.empty() ? std::string{} : headed("Time", table.html());
}

std::string notes_section(const pipeline::Result& result) {
  std::string html;
  for (const Warning& note : result.notes) html += "<li>" + message_of(note) + "</li>\n";
  return html.empty() ? html : headed("Notes: limitations of these data", "<ul>\n" + html + "</ul>\n");
}

std::string warnings_section(const pipeline::Result& result) {
  std::string html;
  for (const Warning& warning : result.warnings) html += "<li>" + message_of(warning) + "</li>\n";
  return html.empty() ? html : headed("Warnings", "<ul>\n" + html + "</ul>\n");
}

}  // namespace helicarm::report
