// SPDX-License-Identifier: Apache-2.0
#include "result_text.h"

#include <fmt/format.h>

#include "helicarm/pipeline/diagnosis/advice.h"
#include "helicarm/report/tables.h"

namespace helicarm::cli {

void print_advice(const pipeline::Result& result, const std::string& report, std::ostream& out) {
  const pipeline::Advice advice = pipeline::advice_for(result);
  if (advice.causes.empty()) return;
  out << "helicarm: likely causes, in order:\n";
  for (std::size_t i = 0; i < advice.causes.size(); ++i)
    out << fmt::format("  {}. {}\n", i + 1, advice.causes[i]);
  out << fmt::format("  Next: {}\n", advice.next);
  if (!report.empty()) out << fmt::format("  All that was found: {}\n", report);
}

std::string summary_of(const pipeline::Result& result) {
  std::string text;
  // Of a single image the camera is the result.
  const report::Table camera =
      result.views.size() == 1 ? report::calibration_table(result.views) : report::Table{};
  for (const report::Table& table :
       {camera, report::statistics_table(result.accuracy), report::points_table(result.points),
        report::tunnels_table(result), report::bone_table(result),
        report::verification_table(report::tools_at_ends(result.verifications))})
    if (!table.rows.empty())
      text += fmt::format("{}{}\n{}", text.empty() ? "" : "\n", table.heading,
                          report::text_of(report::without_empty_columns(table)));
  return text;
}

}  // namespace helicarm::cli
