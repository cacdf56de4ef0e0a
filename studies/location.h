// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "studies/engine.h"
#include "studies/paper_scene.h"
#include "studies/study_files.h"

namespace helicarm::study {

/// Fig. 7: TRE of targets on the planes through the balls' centre along XOY and XOZ.
struct LocationOptions {
  std::size_t groups = 10000;  ///< noise draws
  std::uint64_t seed = 1;
  /// mm, calibrator frame; 6 to 64. Empty: twelve random ones on the spiral, from the seed.
  std::vector<Eigen::Vector3d> balls;
  SigmaReading sigma = SigmaReading::std;
  double fle = printed_fle;
  WorldOrigin origin = WorldOrigin::base;
  double half_mm = 150;  ///< of the planes
  double step_mm = 7.5;
  double interval_mm = 0.5;  ///< between isolines
};

enum class TargetPlane { xoy, xoz };

/// Which of the two images of 1024 x 1024 px contain a target: bits for AP and LAT. A target outside one of
/// them cannot be located in reality; the map shows the result of rays beyond the image.
enum class SeenIn { none, ap, lat, both };

struct LocationPoint {
  TargetPlane plane;
  Eigen::Vector3d place;  ///< mm, calibrator frame
  SeenIn seen_in;
  double tre_fresh;  ///< mean distance (Eq. 12) over the draws, mm; noisy target pixels
  double se_fresh;   ///< its standard error
  double tre_exact;  ///< as above, with exact target pixels
  double se_exact;
};

struct LocationMap {
  std::vector<Eigen::Vector3d> balls;
  Eigen::Vector3d centre;             ///< of the balls
  int side = 0;                       ///< points along each edge of a plane
  std::vector<LocationPoint> points;  ///< XOY, then XOZ; x runs fastest
};

/// No points at ranks other than the leader.
Expected<LocationMap> study_location(const LocationOptions& options, const EngineOptions& engine,
                                     const Ranks& ranks);

/// location.csv, location.json, location.svg and the comparison with the paper.
StudyFiles files_of(const LocationMap& map, const LocationOptions& options);

}  // namespace helicarm::study
