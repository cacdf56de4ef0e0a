// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case_purpose.h"

#include <algorithm>

namespace helicarm::pipeline {

Purpose purpose_of(const Json& case_json) {
  const auto names_camera = [](const Json& view) { return view.is_object() && view.contains("camera"); };
  const bool has_views = case_json.is_object() && case_json.contains("views");
  return has_views && std::ranges::any_of(case_json["views"], names_camera) ? Purpose::registration
                                                                            : Purpose::run;
}

Expected<Case> read_any_case(const std::filesystem::path& path) {
  const auto json = read_json(case_file(path));
  return read_case(path, json ? purpose_of(*json) : Purpose::run);
}

}  // namespace helicarm::pipeline
