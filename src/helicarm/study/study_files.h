// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/core/json.h"

namespace helicarm {

/// What a study writes, and what it says of itself beside the paper.
struct StudyFiles {
  std::string csv;
  Json json;
  std::string svg;
  std::string summary;  ///< a few sentences; also in the JSON
};

}  // namespace helicarm
