// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/study/engine.h"
#include "helicarm/study/paper_scene.h"
#include "helicarm/study/study_files.h"

namespace helicarm {

/// Table 1: the cone on the knee against two plates of balls on the receiver, which turn with the C-arm and
/// whose place a tracker tells. The print gives none of these lengths; the defaults are those of a C-arm
/// whose knee is well above its receiver.
struct BiplaneOptions {
  std::size_t groups = 1000;  ///< experiments of ten tests
  std::uint64_t seed = 1;
  SigmaReading sigma = SigmaReading::std;
  double fle = printed_fle;
  double cone_mm = 620;            ///< from the source to the cone's middle
  double near_plate_mm = 830;      ///< from the source to the plates
  double far_plate_mm = 890;       ///< f is 900
  int balls_a_side = 4;            ///< of each plate; a square lattice, 2 to 5
  double half_plate_mm = 65;       ///< of the lattice, as cast on the detector
  double tracker_sigma_mm = 0.2;   ///< of the plates' tracked place in each view, per axis
  double tracker_sigma_deg = 0.3;  ///< likewise, about the plates' middle
};

/// Largest, least, mean and rms error of a set of points over an experiment's ten tests, mm.
struct ErrorFigures {
  double max, min, mean, rms;
};

/// One cell of Table 1: medians over the experiments.
struct BiplaneRow {
  std::string_view calibrator;  ///< udcsc, biplane
  std::string_view points;      ///< fre, on_biplane, centre, on_udcsc
  std::string_view measure;     ///< intersection: of two views' rays; ray: distance from one view's ray
  ErrorFigures figures;
  std::optional<ErrorFigures> printed = {};
};

/// Empty at ranks that do not lead.
Expected<std::vector<BiplaneRow>> study_biplane(const BiplaneOptions& options, const EngineOptions& engine,
                                                const Ranks& ranks);

/// biplane.csv, biplane.json, biplane.svg and how it compares with the print.
StudyFiles files_of(const std::vector<BiplaneRow>& rows, const BiplaneOptions& options);

}  // namespace helicarm
