// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/report.h"

#include <fmt/format.h>

#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/report/earlier_results.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/overlay.h"
#include "helicarm/report/sections.h"

namespace helicarm::report {

std::string report_html(const pipeline::Result& result) {
  std::string body;
  for (const auto section :
       {summary_section, warnings_section, views_section, tables_section, distortion_section, notes_section})
    body += section(result);
  return page_html(
      "helicarm report", "helicarm", body,
      fmt::format(", method {}. Units: mm and px; pixel (0, 0) is the centre of the top-left pixel.",
                  word(result.options.method)));
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

Expected<void> write_result(const pipeline::Result& result, const std::filesystem::path& folder,
                            bool with_report) {
  auto written = with_report ? write_report(result, folder) : Expected<void>();
  if (written) written = write_file(folder / "result.json", to_text(pipeline::to_json(result)) + "\n");
  if (written) return written;
  std::vector<std::string> overlays;
  for (std::size_t i = 0; i < result.views.size(); ++i)
    overlays.push_back(overlay_name(result.views[i].name, i));
  forget_files(folder, overlays);
  forget_results(folder);
  return written;
}

}  // namespace helicarm::report
