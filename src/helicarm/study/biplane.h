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

namespace helicarm::study {

/// Table 1: the cone on the knee compared with two plates of balls on the receiver, which rotate with the
/// C-arm and whose pose a tracker measures. The paper states none of these lengths; the defaults are those of
/// a C-arm with the knee well above the receiver.
struct BiplaneOptions {
  std::size_t groups = 1000;  ///< experiments of ten tests
  std::uint64_t seed = 1;
  SigmaReading sigma = SigmaReading::std;
  double fle = printed_fle;
  double cone_mm = 620;            ///< from the source to the cone's centre
  double near_plate_mm = 830;      ///< from the source to the plates
  double far_plate_mm = 890;       ///< f is 900
  int balls_a_side = 4;            ///< of each plate: a square lattice, 2 to 5
  double half_plate_mm = 65;       ///< half side of the lattice, projected to the detector
  double tracker_sigma_mm = 0.2;   ///< of the plates' tracked position in each view, per axis
  double tracker_sigma_deg = 0.3;  ///< of the rotation about the plates' centre, per axis
};

/// Largest, least, mean and rms error of a set of points over the ten tests of an experiment, mm.
struct ErrorFigures {
  double max, min, mean, rms;
};

/// One cell of Table 1: medians over the experiments.
struct BiplaneRow {
  std::string_view calibrator;  ///< udcsc, biplane
  std::string_view points;      ///< fre, on_biplane, centre, on_udcsc
  std::string_view
      measure;  ///< intersection: of the rays of two views; ray: distance from the ray of one view
  ErrorFigures figures;
  std::optional<ErrorFigures> printed = {};
};

/// Empty at ranks other than the leader.
Expected<std::vector<BiplaneRow>> study_biplane(const BiplaneOptions& options, const EngineOptions& engine,
                                                const Ranks& ranks);

/// biplane.csv, biplane.json, biplane.svg and the comparison with the paper.
StudyFiles files_of(const std::vector<BiplaneRow>& rows, const BiplaneOptions& options);

}  // namespace helicarm::study
