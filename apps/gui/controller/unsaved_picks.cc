// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/unsaved_picks.h"

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/pipeline/case_picks.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

fs::path unsaved_file(const fs::path& case_folder) { return case_folder / "unsaved_picks.json"; }

}  // namespace

Expected<std::optional<std::vector<pipeline::Pick>>> unsaved_picks(const fs::path& case_folder,
                                                                   const pipeline::Case& the_case) {
  const fs::path file = unsaved_file(case_folder);
  if (!fs::exists(file)) return std::nullopt;
  return read_json(file)
      .and_then([&](const Json& json) {
        return pipeline::picks_from(json, file.filename().string(), the_case.views, the_case.bones);
      })
      .map([](std::vector<pipeline::Pick> picks) { return std::optional(std::move(picks)); });
}

Expected<void> keep_unsaved(const fs::path& case_folder, const std::vector<pipeline::Pick>& picks) {
  Json json = Json::array();
  for (const pipeline::Pick& pick : picks) json.push_back(pipeline::to_json(pick));
  return write_file_in_folder(unsaved_file(case_folder), to_text(json) + "\n");
}

Expected<void> save_picks(const fs::path& case_folder, const std::vector<pipeline::Pick>& picks,
                          const std::vector<pipeline::CaseTunnel>& tunnels) {
  const fs::path file = case_folder / "case.json";
  return read_json(file)
      .and_then(
          [&](Json json) { return pipeline::with_all_picks(std::move(json), picks, tunnels, case_folder); })
      .and_then([&](const Json& json) { return write_file_in_folder(file, to_text(json) + "\n"); })
      .map([&] {
        std::error_code gone;
        fs::remove(unsaved_file(case_folder), gone);
      });
}

}  // namespace helicarm::gui
