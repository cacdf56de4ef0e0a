// SPDX-License-Identifier: Apache-2.0
#include "result_files.h"

#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/report/earlier_results.h"
#include "helicarm/report/overlay.h"
#include "helicarm/report/report.h"

namespace helicarm::cli {

Expected<void> write_result(const pipeline::Result& result, const std::filesystem::path& folder,
                            bool no_report) {
  auto written = no_report ? Expected<void>() : report::write_report(result, folder);
  if (written) written = write_file(folder / "result.json", to_text(pipeline::to_json(result)) + "\n");
  if (written) return written;
  std::vector<std::string> overlays;
  for (std::size_t i = 0; i < result.views.size(); ++i)
    overlays.push_back(report::overlay_name(result.views[i].name, i));
  forget_files(folder, overlays);
  report::forget_results(folder);
  return written;
}

}  // namespace helicarm::cli
