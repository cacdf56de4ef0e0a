// SPDX-License-Identifier: Apache-2.0
#include "result_files.h"

#include "helicarm/core/files.h"
#include "helicarm/report/overlay.h"
#include "helicarm/report/report.h"

namespace helicarm::cli {
namespace {

/// The views of an earlier result in the folder, if any.
std::vector<std::string> earlier_views(const std::filesystem::path& out) {
  std::vector<std::string> names;
  const auto json = read_json(out / "result.json");
  if (!json || !json->is_object() || !json->contains("views") || !(*json)["views"].is_array()) return names;
  for (const Json& view : (*json)["views"])
    if (view.is_object() && view.contains("name") && view["name"].is_string())
      names.push_back(view["name"].get<std::string>());
  return names;
}

void forget(const std::filesystem::path& out, const std::vector<std::string>& views) {
  std::error_code ignored;
  for (const char* file : {"result.json", "report.html"}) std::filesystem::remove(out / file, ignored);
  for (std::size_t i = 0; i < views.size(); ++i)
    std::filesystem::remove(out / report::overlay_name(views[i], i), ignored);
}

}  // namespace

void forget_result(const std::filesystem::path& folder) { forget(folder, earlier_views(folder)); }

Expected<void> write_result(const pipeline::Result& result, const std::filesystem::path& folder,
                            bool no_report) {
  auto written = no_report ? Expected<void>() : report::write_report(result, folder);
  if (written) written = write_file(folder / "result.json", to_text(pipeline::to_json(result)) + "\n");
  if (written) return written;
  std::vector<std::string> views;
  for (const pipeline::ViewResult& view : result.views) views.push_back(view.name);
  forget(folder, views);
  return written;
}

}  // namespace helicarm::cli
