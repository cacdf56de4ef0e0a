// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/core/field.h"
#include "studies/engine.h"
#include "studies/paper_scene.h"
#include "studies/study_files.h"

namespace helicarm::study {

/// Table 1: the cone on the knee compared with two plates of balls on the receiver, which rotate with the
/// C-arm and whose pose a tracker measures. The paper states none of these figures but that a biplane
/// calibrator has fewer than twelve balls; the lengths are those of a C-arm with the knee well above the
/// receiver.
struct BiplaneOptions {
  std::size_t groups = 1000;  ///< experiments of ten tests
  std::uint64_t seed = 1;
  SigmaReading sigma = SigmaReading::std;
  double fle = printed_fle;
  int balls = 8;                   ///< half on each plate, on a lattice of at least 2 x 2
  double cone_mm = 620;            ///< from the source to the cone's centre
  double near_plate_mm = 830;      ///< from the source to the plates
  double far_plate_mm = 890;       ///< f is 900
  double half_plate_mm = 65;       ///< half the near lattice's longer side, projected to the detector
  double tracker_sigma_mm = 0.2;   ///< of the plates' tracked position in each view, per axis
  double tracker_sigma_deg = 0.2;  ///< of the rotation about the plates' centre, per axis
};

inline constexpr Range biplane_balls{8, 50};
inline constexpr std::array<Field<BiplaneOptions>, 6> biplane_fields{
    helicarm::bound<&BiplaneOptions::cone_mm>({.name = "cone_mm",
                                               .flag = "--cone",
                                               .unit = "mm",
                                               .range = {300, 850},
                                               .help = "biplane: from the source to the cone's centre, mm"}),
    helicarm::bound<&BiplaneOptions::near_plate_mm>(
        {.name = "near_plate_mm",
         .flag = "--near-plate",
         .unit = "mm",
         .range = {300, 899},
         .help = "biplane: from the source to the plate nearer to it, mm"}),
    helicarm::bound<&BiplaneOptions::far_plate_mm>(
        {.name = "far_plate_mm",
         .flag = "--far-plate",
         .unit = "mm",
         .range = {300, 900},
         .help = "biplane: from the source to the other plate, mm"}),
    helicarm::bound<&BiplaneOptions::half_plate_mm>(
        {.name = "half_plate_mm",
         .flag = "--half-plate",
         .unit = "mm",
         .range = {10, 150},
         .help = "biplane: half a plate's side on the detector, mm"}),
    helicarm::bound<&BiplaneOptions::tracker_sigma_mm>(
        {.name = "tracker_sigma_mm",
         .flag = "--tracker-mm",
         .unit = "mm",
         .range = {0, 10},
         .help = "biplane: tracker's noise of the plates' position per axis, mm"}),
    helicarm::bound<&BiplaneOptions::tracker_sigma_deg>(
        {.name = "tracker_sigma_deg",
         .flag = "--tracker-deg",
         .unit = "degrees",
         .range = {0, 10},
         .help = "biplane: tracker's noise of the plates' rotation per axis, degrees"})};

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
