// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <span>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/case_registration/registration_figures.h"
#include "helicarm/case_registration/registration_tables.h"
#include "helicarm/core/files.h"
#include "helicarm/image/grey_window.h"
#include "helicarm/image/opencv.h"
#include "helicarm/image/png.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/overlay.h"

namespace helicarm::case_registration {
namespace {

using registration::Registration;

cv::Point pixel_of(const Eigen::Vector2d& at) {
  const Eigen::Vector2d safe = at.cwiseMax(-1e5).cwiseMin(1e5);
  return {int(std::lround(safe.x())), int(std::lround(safe.y()))};
}

/// Marks a point unless it lies behind the source.
void draw_point(cv::Mat& image, const geometry::View& view, const RegisteredPoint& point,
                const cv::Scalar& colour) {
  if (!(view.depth(point.place.in_calibrator) > 1)) return;
  const cv::Point at = pixel_of(view.project(point.place.in_calibrator));
  cv::drawMarker(image, at, colour, cv::MARKER_TILTED_CROSS, image.cols / 60, 2, cv::LINE_AA);
  cv::putText(image, point.name, at + cv::Point(12, -8), cv::FONT_HERSHEY_SIMPLEX, image.cols / 2000.0,
              colour, 1, cv::LINE_AA);
}

/// The planned tunnels in slices of the CT.
std::string slices_html(const RegisteredModel& model) {
  std::string html;
  for (std::size_t i = 0; i < std::min(model.tunnel_slices.size(), model.bone_checks.size()); ++i)
    if (model.tunnel_slices[i] && model.bone_checks[i])
      html += fmt::format(
          "<figure><img alt=\"slices of {0}\" src=\"data:image/png;base64,{1}\"><figcaption>{0}: along the "
          "tunnel "
          "through the thinnest place beside it (cross), along it at a right angle to that, across it there. "
          "Blue: the "
          "bone's surface.</figcaption></figure>\n",
          report::escaped(model.tunnels[i].name),
          report::base64(tunnel_slices_png(*model.tunnel_slices[i], *model.bone_checks[i])));
  return html;
}

/// The measures in the bone, in the words of the program.
std::string measures_html(const RegisteredModel& model) {
  std::string html = "<h3>Quadrants and per cent</h3>\n";
  for (const measures::InBone& measure : model.measures) {
    const std::vector<measures::Line> lines = measures::lines_of(measure);
    html += fmt::format("<p>{}</p>\n<ul>\n", report::escaped(lines.front().text));
    for (const measures::Line& line : std::span(lines).subspan(1))
      html += fmt::format("<li class=\"{}\">{}</li>\n",
                          line.is_warning  ? "bad"
                          : line.depth > 1 ? "soft"
                                           : "",
                          report::escaped(line.text));
    html += "</ul>\n";
  }
  return html;
}

std::string model_section(const RegisteredModel& model) {
  const Registration& r = model.registration;
  std::string html =
      fmt::format("<h2>{}</h2>\n<p><span class=\"state {}\">{}</span></p>\n", report::escaped(r.name),
                  r.failure ? "refused" : "ok", registration::word(r.decision));
  if (r.failure)
    html += fmt::format("<p>{}: {}</p>\n", code(r.failure->reason), report::escaped(r.failure->message));
  for (const auto* list : {&r.warnings, &r.notes})
    for (const Warning& each : *list)
      html += fmt::format("<p class=\"soft\">{}: {}</p>\n", code(each.reason), report::escaped(each.message));
  html += html_of(report::without_empty_columns(models_table({model})));
  if (!r.views.empty()) html += html_of(report::without_empty_columns(views_table(r)));
  if (!model.by_landmarks_only)
    html += fmt::format(
        "<p class=\"soft\">{} of {} starts ended here. Runner-up: {}. Strain that would fit better: {:.2f} "
        "%, sigma "
        "{:.2f} %. {:.1f} s.</p>\n",
        r.agree, r.starts,
        r.runner_up ? fmt::format("{:.1f} mm away, cost ratio {:.2f}", r.runner_up->distance_mm,
                                  r.runner_up->cost_ratio)
                    : "none",
        100 * r.deformation.strain, 100 * r.deformation.sigma, r.seconds);
  if (model.landmarks)
    html += fmt::format("<p>Landmarks: FRE {:.2f} mm, FLE {:.2f} mm (rms).</p>\n", model.landmarks->fre_mm,
                        model.landmarks->fle_mm);
  if (!model.points.empty()) html += html_of(points_table({model}));
  if (!model.measures.empty()) html += measures_html(model);
  const report::Table in_bone = report::without_empty_columns(tunnels_in_bone_table({model}));
  return in_bone.rows.empty() ? html : html + html_of(in_bone) + slices_html(model);
}

}  // namespace

std::string overlay_png(const CaseRegistration& result, std::size_t index) {
  const registration::RegistrationView& view = result.loaded.views[index];
  const auto grey = image::eight_bit(view.grey, image::usual_window(view.grey, view.lowest));
  cv::Mat image;
  cv::cvtColor(image::as_mat(grey), image, cv::COLOR_GRAY2RGB);
  for (std::size_t m = 0; m < result.models.size(); ++m) {
    const RegisteredModel& model = result.models[m];
    const auto& [red, green, blue] = outline_colour(m);
    const cv::Scalar colour(red, green, blue);
    if (index < model.outlines.size())
      for (const Eigen::Vector2d& at : model.outlines[index])
        cv::circle(image, pixel_of(at), std::max(1, image.cols / 1024), colour, cv::FILLED);
    for (const RegisteredPoint& point : model.points) draw_point(image, model.views[index], point, colour);
  }
  return image::encode_png(image);
}

std::string report_html(const CaseRegistration& result) {
  std::string body;
  if (result.failure)
    body += fmt::format("<p><span class=\"state refused\">refused: {}</span></p>\n<p>{}</p>\n",
                        code(result.failure->reason), report::escaped(result.failure->message));
  for (const Warning& warning : result.warnings)
    body +=
        fmt::format("<p class=\"soft\">{}: {}</p>\n", code(warning.reason), report::escaped(warning.message));
  body += shared_images_html(result) + "<div class=\"views\">\n";
  for (std::size_t i = 0; i < result.loaded.views.size(); ++i) body += overlay_figure(result, i);
  body += "</div>\n";
  bool sliders = false;
  for (std::size_t m = 0; m < result.models.size(); ++m) {
    body += model_section(result.models[m]) + alternatives_html(result, m) + model_figures(result, m);
    sliders = sliders || !result.models[m].drrs.empty();
  }
  if (sliders) body += slider_script();
  return report::page_html("helicarm registration", "Registration", body, ". Millimetres and pixels.");
}

Expected<void> write_registration(const CaseRegistration& result, const std::filesystem::path& folder) {
  return guarded([&] {
    for (std::size_t i = 0; i < result.loaded.views.size(); ++i)
      value_or_throw(
          write_file(folder / report::overlay_name(result.loaded.views[i].name, i), overlay_png(result, i)));
    value_or_throw(write_file(folder / "report.html", report_html(result)));
    value_or_throw(write_file(folder / "registration.json", to_text(to_json(result)) + "\n"));
  });
}

}  // namespace helicarm::case_registration
