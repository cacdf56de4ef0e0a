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
#include "helicarm/guidance/verify.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/pipeline/case_model.h"

namespace helicarm::pipeline {

/// One view of the case; the files are in the case's folder.
struct CaseView {
  std::string name;
  std::filesystem::path image;  ///< of a sequence or a run with {frame} or {frame:04d} in its name
  std::optional<int> frame;     ///< 1-based; required if the file has several
  std::optional<std::filesystem::path> plate_image;  ///< a separate acquisition of the plate
  std::optional<std::filesystem::path> map;          ///< a known distortion map
  std::optional<bool> mirrored;                      ///< handedness, if known
  std::optional<double> pixel_mm = {};               ///< in the receiver's plane, where the file lacks it
  std::optional<double> source_detector_mm = {};     ///< likewise
  std::optional<double> primary_deg = {}, secondary_deg = {};  ///< positioner angles, likewise
  guidance::Poses poses;                                       ///< at the acquisition
  std::optional<std::filesystem::path> camera = {};       ///< of another program: the view is not calibrated
  std::optional<std::filesystem::path> calibration = {};  ///< likewise: a result that holds this view
  std::optional<std::string> frames = {};                 ///< of a run of images: "all" or "A-B[:STEP]"
  std::optional<int> frame_offset = {};  ///< the image's number is the sequence's frame plus this
};

enum class Snap { none, ball };

/// What a point lies on, in the user's words; it changes no result, unlike `moves_with`.
struct BoneLabel {
  std::string name;
  std::optional<Side> side = {};

  bool operator==(const BoneLabel&) const = default;
};

/// A pick in one view, raw pixels. Picks of one name in several views are one point.
struct Pick {
  std::string name;
  std::string view;
  Eigen::Vector2d uv_raw;
  Snap snap = Snap::none;
  double diameter_mm = 3;          ///< of the ball to snap to
  std::optional<double> sigma_px;  ///< per axis; 0: exact
  std::optional<guidance::Bone> moves_with;
  std::optional<BoneLabel> bone = {};
  std::optional<int> frame = {};  ///< of a sequence of markers
};

/// An element of case.json's "picks".
Json to_json(const Pick& pick);
/// Fails as `read_case`; `origin` begins each message.
Expected<std::vector<Pick>> picks_from(const Json& picks, const std::string& origin,
                                       const std::vector<CaseView>& views,
                                       const std::vector<guidance::Bone>& bones);

/// A tunnel runs from the pick `start` to the pick `end`.
struct CaseTunnel {
  std::string name;
  std::string start;
  std::string end;
};

/// "markers": what a sequence follows.
struct CaseMarkers {
  double diameter_mm = 1;
};

/// An element of "bodies": a rigid set of markers.
struct CaseBody {
  std::string name;
  std::vector<std::string> markers;
  std::optional<std::filesystem::path> geometry = {};  ///< CSV; nothing: to be learnt
};

/// Images of a case of the purpose `sweep`.
inline constexpr std::size_t most_frames = 1000;

/// What a case is read for: some keys belong to one command, and what may be left out follows from it.
enum class Purpose { run, phantom, registration, sweep, track };

/// case.json and the files it names (docs/formats.md).
struct Case {
  std::filesystem::path folder;
  std::string calibrator_name;  ///< of a built-in, or a file in the folder; empty: none
  phantom::Calibrator calibrator;
  std::optional<std::string> plate_name;                       ///< likewise
  std::optional<phantom::Plate> plate;                         ///< nothing: flat panel
  std::vector<guidance::Bone> bones = guidance::knee_bones();  ///< that markers may follow
  std::vector<CaseView> views;
  guidance::Poses poses_now;
  guidance::TrackerNoise tracker;
  std::vector<Pick> picks;
  std::vector<CaseTunnel> tunnels;
  std::vector<guidance::ToolLine> tool_lines;
  std::vector<CaseModel> models;
  std::vector<ModelLine> model_tunnels;              ///< of the models' plans
  std::vector<double> diameters_mm;                  ///< of the fiducials of a phantom without a file
  std::optional<CaseMarkers> markers;                ///< of a sequence
  std::vector<CaseBody> bodies;                      ///< likewise
  std::optional<std::filesystem::path> calibration;  ///< likewise: as that of every view
  std::optional<double> frame_rate_hz;               ///< likewise
  std::string notes;
  std::vector<Warning> warnings;
};

/// Reads a case from its folder or its case.json, with the calibrator and plate that it names; images and
/// models are not read. One purpose's keys are refused for another's, by name. Cameras of other programs are
/// those of all views or of none; beside them, and for a phantom whose "diameters_mm" are given, the
/// calibrator may be null. Fails with missing_file, bad_json, not_finite, unknown_key, path_outside,
/// name_clash or bad_value.
Expected<Case> read_case(const std::filesystem::path& path, Purpose purpose = Purpose::run);

/// Whether a view, or all of them, bring cameras of other programs, whose world the case then has.
bool brings_camera(const Case& the_case, const CaseView& view);
bool brings_cameras(const Case& the_case);

/// case.json, the inverse of `read_case`. Its images, calibrator and plate must lie in the folder.
Json to_json(const Case& written);

/// The JSON Schema of case.json (docs/schemas).
Json case_schema();

/// What `read_case` checks of picks and poses, for values that are from no file; adds the warnings. Fails as
/// `picks_from`, with name_clash for a pick named as a target, and with bad_value for poses in metres.
Expected<Case> checked_case(Case the_case);

/// The case.json of a case given by its folder or by that file, and its folder.
std::filesystem::path case_file(const std::filesystem::path& path);
std::filesystem::path folder_of_case(const std::filesystem::path& path);

/// As `read_case`, from the content of case.json.
Expected<Case> case_from_json(const Json& json, const std::string& origin,
                              const std::filesystem::path& folder, Purpose purpose = Purpose::run);

}  // namespace helicarm::pipeline
