// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <fmt/format.h>

#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/plate.h"

namespace helicarm::cli {

/// A calibrator by the name of a built-in one or of a file. Throws BadInput, as `read_calibrator`.
inline phantom::Calibrator calibrator_from(const std::string& word) {
  if (phantom::Calibrator built_in = phantom::udcsc(); word == built_in.name) return built_in;
  return value_or_throw(phantom::read_calibrator(word).map_error([](Failure failure) {
    if (failure.reason == Reason::missing_file)
      failure.message += fmt::format("; the built-in calibrator is \"{}\"", phantom::udcsc().name);
    return failure;
  }));
}

/// Likewise a plate.
inline phantom::Plate plate_from(const std::string& word) {
  if (phantom::Plate built_in = phantom::plate48(); word == built_in.name) return built_in;
  return value_or_throw(phantom::read_plate(word).map_error([](Failure failure) {
    if (failure.reason == Reason::missing_file)
      failure.message += fmt::format("; the built-in plate is \"{}\"", phantom::plate48().name);
    return failure;
  }));
}

}  // namespace helicarm::cli
