// SPDX-License-Identifier: Apache-2.0
#include "studies/study_files.h"

#include <cmath>

#include <fmt/format.h>

namespace helicarm::study {

std::string csv_cells(std::span<const double> values) {
  std::string text;
  for (const double value : values) text += std::isfinite(value) ? fmt::format(",{}", value) : ",";
  return text;
}

}  // namespace helicarm::study
