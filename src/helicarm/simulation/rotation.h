// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/simulation/simulate_case.h"

namespace helicarm::simulation {

/// The file of a run's images.
inline constexpr const char* run_file = "RUN.dcm";

/// A rotational run: images at equal steps of the primary angle about AP.
struct Rotation {
  int frames = 133;      ///< 2 to 1000
  double arc_deg = 200;  ///< from the first image to the last, at most 360
  /// Largest displacement of source or detector by the arm's sag over the run; nothing: the C-arm's own.
  std::optional<double> flex_mm = {};
  double jitter_mm = 0.03;  ///< of source and detector in each image: standard deviation per axis
};

/// Of source and detector along the camera's axes, mm.
struct Displacement {
  Eigen::Vector3d source = Eigen::Vector3d::Zero();
  Eigen::Vector3d detector = Eigen::Vector3d::Zero();
};

/// What displaces source and detector in one image.
struct RunDeviation {
  Displacement flex;    ///< sag, against the undeformed arm
  Displacement jitter;  ///< of this image
};

/// Views RUN/1, RUN/2 and so on of a rotation.
struct RunStand {
  std::vector<TrueView> views;
  std::vector<RunDeviation> deviations;
};

/// The views of a rotation by the C-arm of the arm's seed, as `take_stand` gives those of a case; without its
/// positioning errors, with the jitter in place of its unrepeated part.
RunStand take_run(const SimulationOptions& options, const Rotation& rotation, double plate_height_mm,
                  const geometry::RigidTransform& calibrator_from_patient);

/// Centre of the image on the detector, mm, calibrator frame.
Eigen::Vector3d detector_in_calibrator(const TrueView& view);

struct SimulatedRun {
  Rotation rotation;
  SimulatedCase images;
  std::vector<RunDeviation> deviations;  ///< of each image
};

/// A run of images; reproducible from the seed. Refuses as `simulate_case`, kinds tunnels and grid and
/// options of views (usage), preset paper-sim, the fault wires, and numbers out of range (bad_value). An
/// image may have 256 pixels a side.
Expected<SimulatedRun> simulate_run(const SimulationOptions& options, const Rotation& rotation);

/// case.json of the run, for `helicarm sweep`.
Json case_json(const SimulatedRun& run);
/// truth.json with `run`, and source, detector, flex and jitter of each view.
Json truth_json(const SimulatedRun& run);

/// Writes RUN.dcm, an XA file of several frames with their angles, calibrator.json, plate.json, case.json and
/// truth.json, as `write_case` does.
Expected<void> write_run(const std::filesystem::path& folder, const SimulatedRun& run);

}  // namespace helicarm::simulation
