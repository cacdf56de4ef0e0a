// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/report.h"

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/report/overlay.h"
#include "helicarm/report/sections.h"
#include "helicarm/report/style.h"

namespace helicarm::report {

std::string report_html(const pipeline::Result& result) {
  std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>helicarm "
      "report</title>\n";
  html += fmt::format("<style>{}</style>\n</head>\n<body>\n<header>\n<h1>helicarm</h1>\n", report_style);
  html += "<p class=\"notice\">Research instrument, not a medical device.</p>\n</header>\n<main>\n";
  for (const auto section :
       {summary_section, warnings_section, views_section, accuracy_section, points_section, guidance_section,
        fiducials_section, rectification_section, notes_section, timing_section})
    html += section(result);
  html += fmt::format(
      "</main>\n<footer><p class=\"soft\">helicarm {}, method {}. Units: mm and px; pixel (0, 0) is the "
      "centre of the top-left pixel.</p></footer>\n</body>\n</html>\n",
      HELICARM_VERSION, result.options.method == rectification::Method::paper ? "paper" : "best");
  return html;
}

Expected<void> write_report(const pipeline::Result& result, const std::filesystem::path& folder) {
  if (auto written = write_file(folder / "report.html", report_html(result)); !written) return written;
  for (std::size_t i = 0; i < result.views.size(); ++i)
    if (result.views[i].xray_image)
      if (auto written = write_file(folder / overlay_name(result.views[i].name, i), overlay_png(result, i));
          !written)
        return written;
  return {};
}

}  // namespace helicarm::report
