// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "command.h"
#include "helicarm/study/biplane.h"
#include "helicarm/study/calibration_study.h"

namespace helicarm::cli {

/// Omitted options take the study's defaults.
struct StudyArguments {
  /// number, uniformity, location, biplane, biplane-images, calibration, rectification, design, limit or
  /// centres
  std::string name;
  std::optional<std::size_t> groups;
  std::filesystem::path out = "helicarm-study";
  bool resume = false;
  std::vector<int> balls;
  std::vector<std::string> sigmas;
  std::vector<std::string> readings;
  std::optional<double> fle;
  std::string origin;
  std::optional<int> draws;
  std::string calibrator;
  std::string surface;
  study::BiplaneOptions biplane;               ///< of biplane_fields
  study::CalibrationStudyOptions calibration;  ///< of calibration_fields
};

/// Runs a simulated experiment and writes NAME.csv, NAME.json and NAME.svg. The same seed gives the same
/// bytes, whatever the number of threads and ranks.
CommandResult study_command(const StudyArguments& arguments, Console& console);

}  // namespace helicarm::cli
