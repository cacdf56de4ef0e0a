// SPDX-License-Identifier: Apache-2.0
// A reconstruction's check as table, slices and CSV.
#include <array>
#include <string>

#include <fmt/format.h>

#include "helicarm/core/csv.h"
#include "helicarm/image/png.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/table.h"
#include "helicarm/sweep/reconstruction_check.h"

namespace helicarm::sweep {
namespace {

std::string slice_html(const CheckedImage& image, const std::string& caption) {
  if (image.slice.empty()) return "";
  return fmt::format(
      "<figure class=\"plain\" style=\"display:inline-block;margin:0 0.6em 0.6em 0\"><img alt=\"{0}\" "
      "style=\"width:11em;image-rendering:pixelated\" src=\"data:image/png;base64,{1}\"/><figcaption>{0}, "
      "{2:.1f} mm wide</figcaption></figure>",
      report::escaped(caption), report::base64(image::encode_png(image.slice)), image.side_mm);
}

std::string width_field(const std::optional<double>& width) {
  return width ? fmt::format("{:.4f}", *width) : "";
}

std::optional<double> other_width(const CheckedTarget& target) {
  return target.other ? target.other->width_mm : std::nullopt;
}

report::Table check_table(const ReconstructionCheck& check) {
  using Column = report::ColumnOf<CheckedTarget>;
  const auto width = [](const char* title, const char* definition, auto value) {
    return Column{{title, definition, true},
                  [value](const CheckedTarget& t) { return report::Cell{report::fixed(value(t), 3)}; }};
  };
  return report::without_empty_columns(report::table_of<CheckedTarget>(
      "Width at half maximum, mm",
      {{{"Target", "Ball or wire"}, [](const CheckedTarget& t) { return report::Cell{t.name}; }},
       width("Diameter", "Of the ball, by the calibrator's file",
             [](const CheckedTarget& t) { return t.diameter_mm; }),
       width("This geometry", "The cameras of sweep.json",
             [](const CheckedTarget& t) { return t.own.width_mm; }),
       width("Ideal circle", "The circle about the axis that fits these cameras best",
             [](const CheckedTarget& t) { return t.circle.width_mm; }),
       width("Other program", "The cameras that were given", other_width)},
      check.targets));
}

}  // namespace

std::string check_csv(const ReconstructionCheck& check) {
  std::string csv = "target,diameter_mm,width_mm,circle_width_mm,other_width_mm\n";
  for (const CheckedTarget& target : check.targets)
    csv += fmt::format("{},{},{},{},{}\n", csv_field(target.name), width_field(target.diameter_mm),
                       width_field(target.own.width_mm), width_field(target.circle.width_mm),
                       width_field(other_width(target)));
  return csv;
}

std::string check_html(const ReconstructionCheck& check) {
  std::string html = "<h2>Reconstruction</h2>\n<p>" + report::escaped(check.program) +
                     fmt::format(", FDK of {} images", check.images);
  if (const auto ratio = check.circle_ratio())
    html += fmt::format(": with the ideal circle the targets are {:.2f} times as wide (median)", *ratio);
  if (const auto ratio = check.other_ratio())
    html += fmt::format(", with the other program's cameras {:.2f} times", *ratio);
  html += ".</p>\n" + html_of(check_table(check));
  for (const CheckedTarget& target : check.targets) {
    html += "<div>" + slice_html(target.own, target.name + ", this geometry") +
            slice_html(target.circle, target.name + ", ideal circle");
    if (target.other) html += slice_html(*target.other, target.name + ", other program");
    html += "</div>\n";
  }
  return html;
}

}  // namespace helicarm::sweep
