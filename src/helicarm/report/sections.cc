// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/sections.h"

#include <fmt/format.h>

#include "helicarm/pipeline/diagnosis/advice.h"
#include "helicarm/report/figures.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/tables.h"

namespace helicarm::report {
namespace {

std::string headed(std::string_view heading, const std::string& content) {
  return content.empty() ? std::string{}
                         : fmt::format("<section><h2>{}</h2>\n{}</section>\n", heading, content);
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
    html += fmt::format("<p><span class=\"state refused\">refused</span> {}</p>\n",
                        escaped(message_of(*result.failure))) +
            advice_of(result);
  else
    html += "<p><span class=\"state ok\">measured</span></p>\n";
  std::string cards;
  for (const KeyFigure& figure : key_figures(result))
    cards += fmt::format("<div class=\"card\"><b>{} <small>{}</small></b><span>{}</span></div>\n",
                         figure.value, figure.unit, figure.what);
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

std::string tables_section(const pipeline::Result& result) {
  std::string html;
  for (const Table& table : tables_of(result)) html += headed(table.heading, html_of(table));
  return html;
}

std::string distortion_section(const pipeline::Result& result) {
  std::string figures;
  for (const pipeline::ViewResult& view : result.views)
    if (const std::string figure = distortion_figure(view); !figure.empty())
      figures += fmt::format(
          "<figure class=\"plain\">{}<figcaption>{}: displacement from rectified to raw "
          "position.</figcaption></figure>\n",
          figure, escaped(view.name));
  return figures.empty() ? figures : headed("Distortion", "<div class=\"views\">\n" + figures + "</div>\n");
}

std::string notes_section(const pipeline::Result& result) {
  std::string html;
  for (const Warning& note : result.notes) html += "<li>" + escaped(message_of(note)) + "</li>\n";
  return html.empty() ? html : headed("Notes: limitations of these data", "<ul>\n" + html + "</ul>\n");
}

std::string warnings_section(const pipeline::Result& result) {
  std::string html;
  for (const Warning& warning : result.warnings) html += "<li>" + escaped(message_of(warning)) + "</li>\n";
  return html.empty() ? html : headed("Warnings", "<ul>\n" + html + "</ul>\n");
}

}  // namespace helicarm::report
