// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace helicarm::cli {

enum class PhantomAction { show, check, export_files, design, measure, verify };

/// `helicarm phantom show|check|export [NAME_OR_FILE] [--plate] [--stl FILE] [--svg FILE]`. With --json,
/// `design --knee D1,D2` proposes a calibrator for a knee; with --svg and --file as `export`. With --json,
/// `show` prints a valid calibrator.json or plate.json. `helicarm phantom measure CASE --out DIR` and
/// `helicarm phantom verify CASE` read a case instead.
struct PhantomArguments {
  PhantomAction action = PhantomAction::show;
  std::string name_or_file;                      ///< name of a built-in or a file; empty: udcsc or plate48
  bool plate = false;                            ///< the rectification plate instead of the calibrator
  std::optional<std::filesystem::path> stl;      ///< export: the printable body
  std::optional<std::string> body;               ///< export: cone, rings or plate; nothing: the suitable one
  double clearance_mm = 0;                       ///< export: pocket's diameter less the ball's
  double step_mm = 1;                            ///< export: of the body's surface
  std::optional<std::filesystem::path> svg;      ///< export: the drawing
  std::optional<std::filesystem::path> file;     ///< export: calibrator.json or plate.json
  std::vector<double> knee_mm;                   ///< design: d1, d2 of Fig. 4
  std::optional<std::filesystem::path> out;      ///< measure, verify: folder of the result
  bool from_scratch = false;                     ///< measure: without a nominal file
  std::vector<std::string> distances;            ///< measure: A,B=MM or u1,v1;u2,v2=MM
  std::optional<double> distance_sigma_mm;       ///< measure
  std::string distance_is = "centres";           ///< measure: centres or outer
  std::optional<std::filesystem::path> history;  ///< verify: JSON, to which this verification is added
};

}  // namespace helicarm::cli
