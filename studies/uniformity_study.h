// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "helicarm/core/failure.h"
#include "studies/engine.h"
#include "studies/paper_scene.h"
#include "studies/study_files.h"

namespace helicarm::study {

/// Fig. 6: uniformity E(A) of random balls (Eq. 13) compared with their TRE.
struct UniformityOptions {
  std::size_t groups = 1000;
  std::uint64_t seed = 1;
  int balls = 12;   ///< 6 to 64
  int draws = 100;  ///< noise draws per group, over which TRE is averaged; the first is also reported alone
  SigmaReading sigma = SigmaReading::std;
  double fle = printed_fle;
  WorldOrigin origin = WorldOrigin::base;
};

/// TRE (Eq. 12, mm) by region of the targets.
struct PlacedTre {
  double ball, cone, centre;
};

struct UniformityGroup {
  double uniformity;           ///< E(A) in the sphere of 100 mm about the origin
  PlacedTre one, one_exact;    ///< of the first draw; exact: only the calibration is noisy
  PlacedTre mean, mean_exact;  ///< over all draws
};

/// One entry for each group; empty at ranks other than the leader.
Expected<std::vector<UniformityGroup>> study_uniformity(const UniformityOptions& options,
                                                        const EngineOptions& engine, const Ranks& ranks);

/// uniformity.csv, uniformity.json, uniformity.svg and the comparison with the paper.
StudyFiles files_of(const std::vector<UniformityGroup>& groups, const UniformityOptions& options);

}  // namespace helicarm::study
