// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/guidance/poses.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/verification/verify.h"

namespace helicarm {

/// One exposure of the case; the files are below the case's folder.
struct CaseView {
  std::string name;
  std::filesystem::path image;
  std::optional<int> frame;                          ///< 1-based; needed only if the file has several
  std::optional<std::filesystem::path> plate_image;  ///< the plate was acquisition apart
  std::optional<std::filesystem::path> map;          ///< the distortion is known
  std::optional<bool> mirrored;                      ///< what the C-arm is known to do
  Poses poses;                                       ///< at the moment of the exposure
};

enum class Snap { none, ball };

/// A click on one view, in raw pixels. Picks of one name in several views are one point.
struct Pick {
  std::string name;
  std::string view;
  Eigen::Vector2d uv_raw;
  Snap snap = Snap::none;
  double diameter_mm = 3;          ///< of the ball to snap to
  std::optional<double> sigma_px;  ///< per axis; 0: exact
  std::optional<Bone> moves_with;
};

/// As an entry of case.json's "picks".
Json to_json(const Pick& pick);
/// Strictly; fails as `read_case`. `origin` begins each message.
Expected<std::vector<Pick>> picks_from(const Json& picks, const std::string& origin,
                                       const std::vector<CaseView>& views);

/// A tunnel runs from the pick `start` to the pick `end`.
struct TunnelPlan {
  std::string name;
  std::string start;
  std::string end;
};

/// What `helicarm run` is given: case.json and the descriptions it names (docs/formats.md).
struct Case {
  std::filesystem::path folder;
  Calibrator calibrator;
  std::optional<Plate> plate;  ///< nothing: a flat panel
  std::vector<CaseView> views;
  Poses poses_now;
  TrackerNoise tracker;
  std::vector<Pick> picks;
  std::vector<TunnelPlan> tunnels;
  std::vector<ToolLine> tool_lines;
  std::vector<double> diameters_mm;  ///< kinds of ball of a phantom that is measured from scratch
  std::vector<Warning> warnings;
};

/// Reads a case strictly, given by its folder or by its case.json, and the calibrator and the plate it names.
/// Images are not opened. Fails with missing_file, bad_json, not_finite, unknown_key, path_outside,
/// name_clash or bad_value.
Expected<Case> read_case(const std::filesystem::path& path);

/// As `read_case`, for a case whose phantom is measured: one view or more, and the calibrator may be null
/// where "diameters_mm" is given (`calibrator` then has no balls).
Expected<Case> read_phantom_case(const std::filesystem::path& path);

}  // namespace helicarm
