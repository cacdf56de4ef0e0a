// SPDX-License-Identifier: Apache-2.0
#include "export_command.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/json.h"
#include "helicarm/report/exports.h"

namespace helicarm::cli {
namespace {

std::vector<report::Export> exports_named(const std::vector<std::string>& words) {
  std::vector<report::Export> kinds;
  for (const std::string& word : words) {
    const auto found = std::ranges::find(report::export_words, word);
    if (found == report::export_words.end())
      throw BadInput(Reason::usage,
                     fmt::format("--as: \"{}\" is none of: {}", word, fmt::join(report::export_words, ", ")));
    kinds.push_back(report::every_export[std::size_t(found - report::export_words.begin())]);
  }
  if (kinds.empty()) kinds.assign(report::every_export.begin(), report::every_export.end());
  return kinds;
}

}  // namespace

CommandResult export_command(const ExportArguments& arguments, Console& console) {
  return guarded([&] {
    report::forget_exports(arguments.run.out);
    const std::vector<report::Export> kinds = exports_named(arguments.as);
    const std::filesystem::path& folder = arguments.run.folder;
    if (std::filesystem::exists(folder / "result.json") && !std::filesystem::exists(folder / "case.json"))
      throw BadInput(
          Reason::usage,
          fmt::format("{}: holds a result; give the folder of the case instead, which is then measured again",
                      folder.string()));
    const pipeline::Result result = value_or_throw(measure(arguments.run, console)).result;
    const auto written = value_or_throw(report::write_exports(result, arguments.run.out, kinds));
    if (console.json) {
      Json files = Json::array();
      for (const auto& path : written) files.push_back(path.string());
      console.out << to_text({{"written", std::move(files)}}) << '\n';
    } else {
      for (const auto& path : written) console.out << path.string() << '\n';
    }
  });
}

}  // namespace helicarm::cli
