// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/calibration/c_arm_history.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/sweep/path.h"
#include "helicarm/sweep/reconstruction_check.h"
#include "helicarm/sweep/sweep_case.h"

namespace helicarm::report {
struct Chart;
}

namespace helicarm::sweep {

enum class PathKind { free, smooth };
inline constexpr std::array<std::string_view, 2> path_words{"free", "smooth"};
/// By its word; bad_value otherwise.
Expected<PathKind> path_kind(const std::string& word);

enum class Decision { accept, warn, refuse };

struct SweepOptions {
  std::optional<PathKind> path = {};  ///< nothing: smooth where more than 15 frames of one run are accepted
  unsigned threads = 0;               ///< 0: all cores
};

/// One frame's camera: the best estimate, and that of the frame alone.
struct SweepFrame {
  int number = 0;
  std::string view;
  Decision decision = Decision::refuse;
  std::optional<Failure> failure;  ///< of a refused frame
  std::optional<double> primary_angle_deg, secondary_angle_deg;
  int fiducials_used = 0;
  /// One per ball of the calibrator, with their residuals about `best`; none where no label was accepted.
  std::vector<fiducials::Fiducial> fiducials;
  std::optional<calibration::CalibratedView> best, alone;
  std::optional<double> path_angle_deg;  ///< along the path, from the first frame
  std::optional<double> off_path_sigma;  ///< of this frame from the path of the others
  /// Of the path, and of the camera, from the reference orbit at one angle: that of the camera's source.
  std::optional<CameraVector> flex, own;
};

/// The curve of source and detector.
struct SweepPath {
  PathKind kind = PathKind::free;
  std::optional<Eigen::Vector3d> axis;  ///< unit vector, calibrator frame
  Eigen::Vector3d isocentre = Eigen::Vector3d::Zero();
  Eigen::Vector3d isocentre_sigma = Eigen::Vector3d::Zero();
  double isocentre_radius_mm = 0;  ///< largest distance of a central ray from the isocentre
  double source_to_axis_mm = 0;
  std::optional<double> source_to_detector_mm;  ///< nothing without a pixel size
  double arc_deg = 0;
  std::optional<Stiffness> stiffness;
};

struct Sweep {
  std::optional<Failure> failure;  ///< of the run as a whole
  std::vector<Warning> warnings, notes;
  Detector detector;
  bool pixel_known = false;
  std::vector<SweepFrame> frames;
  std::optional<SweepPath> path;
  std::vector<calibration::HistoryEntry>
      acquisitions;                          ///< for the C-arm's record: of up to 40 frames, evenly spaced
  std::optional<ReconstructionCheck> check;  ///< where it was asked for and possible
  double noise_factor = 1;  ///< of the fiducials' standard deviations, by all frames' residuals
  double seconds = 0;
};

/// Calibrates every image of a run alone and all of them on one path. Unreadable input (exit code 2) fails; a
/// refusal of the run or of a frame is in the result. `progress`: share of the images that are done.
Expected<Sweep> run_sweep(const SweepCase& the_case, const SweepOptions& options = {},
                          const std::function<void(double share)>& progress = {});

/// Sets `check`, or a warning that says why it is left out: no such program, too small an arc, no ball free.
/// Fails as `check_reconstruction` otherwise. A refused run stays as it is.
Expected<void> add_check(Sweep& sweep, const SweepCase& the_case, const CheckOptions& options,
                         const std::function<void(double share)>& progress = {});

/// sweep.json (docs/formats.md).
Json to_json(const Sweep& sweep);

/// The JSON Schema of sweep.json.
Json sweep_schema();

/// The report's charts: deviations of source and detector from the reference orbit over the angle; residuals
/// and standard deviations by image, with the refused ones. Empty without them.
std::vector<report::Chart> path_charts(const Sweep& sweep);
std::vector<report::Chart> image_charts(const Sweep& sweep);

/// report.html as one page.
std::string sweep_report(const Sweep& sweep);

/// Writes sweep.json, geometry/, frames.csv, report.html and of a check check.csv into the folder. A refused
/// run has no geometry/.
Expected<void> write_sweep(const Sweep& sweep, const std::filesystem::path& folder);

/// Removes what `write_sweep` wrote into the folder earlier.
void forget_sweep(const std::filesystem::path& folder);

}  // namespace helicarm::sweep
