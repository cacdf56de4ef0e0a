// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "helicarm/core/failure.h"
#include "studies/engine.h"
#include "studies/study_files.h"

namespace helicarm::study {

/// The paper's 3.1 (Figs. 9 to 11) from images: each intensifier images the plate, which gives the maps, and
/// then the test grid of wires at several distances from the receiver.
struct RectificationStudyOptions {
  std::size_t groups = 10;  ///< intensifiers
  std::uint64_t seed = 1;
  int size_px = 1024;  ///< 512 or 1024
  /// From the receiver to the wires. The paper has ten distances and states one, 45 mm.
  std::vector<double> distances_mm = {30, 45, 60, 75, 90, 105, 120, 135, 150, 165};
  double figure_distance_mm = 45;  ///< of Figs. 9 and 10, whose crosses are kept; one of the above
};

/// Mean and largest error over the crosses of one image (Eq. 15), in raw pixels; NaN: no answer.
struct GridErrors {
  double raw_mean, raw_max;
  double paper_mean, paper_max;  ///< rectified by the published method: Hough centres, quadratic model
  double best_mean, best_max;    ///< rectified by the best method
};

struct GridImage {
  double crosses;     ///< found, and within both maps
  double finder_rms;  ///< error of the detected crosses against their true positions, px
  GridErrors nine;    ///< ideal grid from the nine central crosses (Eq. 14)
  GridErrors all;     ///< ideal grid from all crosses
};

/// One cross; NaN: not found. Ideal position from the nine crosses of the raw image.
struct GridCross {
  double u, v, ideal_u, ideal_v, raw_error, paper_error, best_error;
};

constexpr std::size_t crosses_of_grid = 81;

struct Intensifier {
  std::uint32_t case_seed;  ///< `helicarm simulate --kind grid --seed` gives the same one
  std::vector<GridImage> images;
  std::array<GridCross, crosses_of_grid> crosses;  ///< at figure_distance_mm, row by row
};

/// Empty at ranks other than the leader.
Expected<std::vector<Intensifier>> study_rectification(const RectificationStudyOptions& options,
                                                       const EngineOptions& engine, const Ranks& ranks);

/// rectification.csv, rectification.json, rectification.svg and the comparison with the paper.
StudyFiles files_of(const std::vector<Intensifier>& intensifiers, const RectificationStudyOptions& options);

}  // namespace helicarm::study
