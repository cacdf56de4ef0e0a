// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "helicarm/core/json.h"
#include "helicarm/study/paper_scene.h"

namespace helicarm {

/// What a study writes, and what it says of itself beside the paper.
struct StudyFiles {
  std::string csv;
  Json json;
  std::string svg;
  std::string summary;  ///< a few sentences; also in the JSON
};

/// Cells of a CSV row, a comma before each; empty where a number is not finite.
std::string csv_cells(std::span<const double> values);

/// How every study's JSON begins: what it is, and those of its options that several studies share.
template <class Options>
Json study_json(const char* study, const Options& options) {
  Json json{{"format", "helicarm-study/1"},
            {"study", study},
            {"groups", options.groups},
            {"seed", options.seed},
            {"version", HELICARM_VERSION}};
  if constexpr (requires { options.sigma; }) {
    json["sigma"] = name_of(options.sigma);
    json["sigma_px"] = sigma_px(options.sigma, options.fle);
  }
  if constexpr (requires { options.origin; }) json["origin"] = name_of(options.origin);
  return json;
}

}  // namespace helicarm
