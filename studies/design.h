// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/calibrator.h"
#include "studies/engine.h"
#include "studies/paper_scene.h"
#include "studies/study_files.h"

namespace helicarm::study {

/// Surface for the balls of a designed calibrator: the spiral of Eq. 9, its cone, or a dome (half an
/// ellipsoid) of the same base and height.
enum class DesignSurface { helix, cone, dome };
inline constexpr std::array design_surfaces{DesignSurface::helix, DesignSurface::cone, DesignSurface::dome};
std::string_view name_of(DesignSurface surface);

/// Searches the ball positions with the least TRE in the cone, under the rules of 2.3.4 that do not depend on
/// labels (`check_rules`: no ball occludes another over +-5 degrees, all are in the image, the targets lie
/// within the balls).
struct DesignOptions {
  std::size_t groups = 10000;  ///< random sets for comparison
  std::uint64_t seed = 1;
  int balls = 12;  ///< 6 to 20
  DesignSurface surface = DesignSurface::helix;
  SigmaReading sigma = SigmaReading::std;
  double fle = printed_fle;
  int restarts = 8;
  int steps = 2000;  ///< of each restart: one ball is moved, kept if better
};

inline constexpr std::size_t tried_random_sets = 500;  // best random sets checked against the rules

struct DesignedSet {
  phantom::Calibrator calibrator;
  double tre_mm = 0;  ///< rms over noise and the cone's targets with exact pixels, from separate draws
  bool keeps_rules = false;
};

struct DesignAnswer {
  DesignedSet design;
  DesignedSet best_random;        ///< without regard to the rules
  DesignedSet best_random_ruled;  ///< the best that keeps the rules; no balls if none does
  DesignedSet udcsc;
  double median_random_mm = 0;
};

/// No balls at ranks other than the leader. `uncertain` if no restart finds a set that keeps the rules.
Expected<DesignAnswer> study_design(const DesignOptions& options, const EngineOptions& engine,
                                    const Ranks& ranks);

/// design.csv, design.json (with the calibrator as a file for `phantom` and cases), design.svg and a summary.
StudyFiles files_of(const DesignAnswer& answer, const DesignOptions& options);

}  // namespace helicarm::study
