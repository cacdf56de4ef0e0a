// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/simulation/simulate_case.h"
#include "studies/engine.h"
#include "studies/study_files.h"

namespace helicarm::study {

/// Table 1's columns of the biplane calibrator from images (Fig. 13): the scenes of `study_calibration` with
/// eight balls in two planes on the receiver, which turn with the C-arm. Each test is a case whose calibrator
/// is the biplane, tracked in both views; the points on UDCSC are clicked and located in the tracker's frame.
struct BiplaneImagesOptions {
  std::size_t groups = 10;  ///< tests, each with an AP and a lateral image
  std::uint64_t seed = 1;
  int size_px = 1024;              ///< 512 or 1024
  std::filesystem::path folder;    ///< for the temporary cases
  double tracker_sigma_mm = 0.2;   ///< of the tracked position in each view, per axis
  double tracker_sigma_deg = 0.2;  ///< of the rotation about the balls' centroid, per axis
  double click_sigma_px = 0.5;     ///< of the points on UDCSC, per axis
};

/// Mean, largest, least and rms error of `n` points, mm; NaN if n is 0.
struct PointErrors {
  double n = 0, mean, max, min, rms;
};

/// One test by one method.
struct BiplaneImageTest {
  double refused = 1;    ///< 1: refused
  PointErrors fre;       ///< the balls' distances from their own rays
  PointErrors centre;    ///< T1
  PointErrors on_udcsc;  ///< twelve balls and four targets
};

struct BiplaneImageTests {
  std::uint32_t case_seed;
  BiplaneImageTest paper, best;
};

/// Eight balls in two planes 60 mm apart, irregular so that their labels are unambiguous. Axes as the
/// camera's, origin at the centroid of the planes.
phantom::Calibrator biplane_calibrator();

/// The calibrator's place on the receiver, from the source.
inline constexpr double biplane_depth_mm = 860;

/// A simulated case with the biplane's balls in both images too.
simulation::SimulatedCase with_biplane(simulation::SimulatedCase simulated);

/// The first test's case stays in the folder under this name, for `helicarm run`.
inline constexpr const char* kept_biplane_case = "biplane-case";

/// Empty at ranks other than the leader.
Expected<std::vector<BiplaneImageTests>> study_biplane_images(const BiplaneImagesOptions& options,
                                                              const EngineOptions& engine,
                                                              const Ranks& ranks);

/// biplane-images.csv, biplane-images.json and the comparison with the paper.
StudyFiles files_of(const std::vector<BiplaneImageTests>& tests, const BiplaneImagesOptions& options);

}  // namespace helicarm::study
