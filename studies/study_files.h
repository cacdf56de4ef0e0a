// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "helicarm/core/json.h"
#include "studies/paper_scene.h"

namespace helicarm::study {

/// Output of a study, with its comparison with the paper.
struct StudyFiles {
  std::string csv;
  Json json;
  std::string svg;
  std::string summary;  ///< a few sentences; also in the JSON
};

/// Cells of a CSV row, each after a comma; empty for a non-finite number.
std::string csv_cells(std::span<const double> values);

/// Common head of the studies' JSON: the study and the options that several studies share.
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

}  // namespace helicarm::study
