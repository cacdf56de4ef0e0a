// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/image/image.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/simulation/navigation_truth.h"
#include "helicarm/simulation/simulation_options.h"
#include "helicarm/simulation/truth.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::simulation {

/// A user's pick near a tunnel's ball, raw pixels.
struct Click {
  std::string point;
  Eigen::Vector2d raw;
};

/// One stored image with its ground truth.
struct SimulatedView {
  TrueView true_view;
  image::Image<std::uint16_t> pixels;
  std::vector<TruePoint> balls;
  std::vector<TruePoint> targets;
  std::vector<TruePoint> tunnel_points;
  std::vector<TruePoint> plate_dots;
  std::vector<TruePoint> crosses;  ///< of the test grid
  std::vector<Click> clicks;
};

struct SimulatedCase {
  SimulationOptions options;
  phantom::Calibrator calibrator;  ///< without balls in kind grid
  std::optional<phantom::Plate> plate;
  std::vector<SimulatedView> views;
  std::optional<NavigationTruth> navigation;
  std::optional<geometry::RigidTransform>
      calibrator_from_knee;                                    ///< pose of knee_body; nothing without a knee
  std::optional<geometry::RigidTransform> calibrator_from_ct;  ///< pose of the CT's patient frame (L, P, S)
};

/// A whole case from its options; reproducible from the seed. Refuses (bad_value) an unknown size, depth or
/// ball, a preset that does not suit the kind, and a grid that is not in front of the plate.
Expected<SimulatedCase> simulate_case(const SimulationOptions& options);

/// The image as the reader would return it, without a file.
xray::XrayImage exposure_of(const SimulatedView& view);

}  // namespace helicarm::simulation
