// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/simulation/ct_body.h"

namespace helicarm::simulation {

enum class CaseKind {
  accuracy,  ///< the paper's 3.2: intensifier, plate, five check targets
  tunnels,   ///< an ACL navigation: intensifier, plate, balls at the tunnels' ends, tracker and tool
  flat,      ///< as accuracy, with a flat panel: no plate, no distortion
  grid       ///< the paper's 3.1: images of the plate alone and with the wire test grid in front of it
};

/// C-arm models. Pixel sizes apply to 1024 pixels per side and double with 512.
enum class Preset {
  paper_sim,  ///< the paper's 2.3.3: f 900 mm, 0.15 mm pixels, AP and lateral view at 800 mm, ideal alignment
  ii_9in,     ///< 9 inch intensifier: 0.2295 mm pixels, 997 mm, with plate, distortion, sag and tilt
  flat_panel  ///< 0.29 mm pixels, 1020 mm, with sag and tilt; no distortion
};

/// Relation of the grey values to the signal.
enum class Response { linear, logarithmic };

enum class Fault {
  decoys,     ///< two stray balls of the calibrator's size
  wires,      ///< a K-wire over a ball in each view
  screws,     ///< two screws in the tibia
  low_dose,   ///< 1/20 of the quanta
  shutters,   ///< collimator leaves inside the field
  mirrored,   ///< the second view (the lateral) is stored mirrored, and tagged so
  saturated,  ///< the open beam exceeds the highest grey value
};

/// Their names on the command line and in truth.json; an unknown one is a `usage` failure.
std::string_view word(CaseKind kind);
std::string_view word(Preset preset);
std::string_view word(Fault fault);
std::string_view word(Response response);
Expected<CaseKind> case_kind(std::string_view word);
Expected<Preset> preset(std::string_view word);
Expected<Fault> fault(std::string_view word);
Expected<Response> response(std::string_view word);  ///< linear or log

/// C-arm angles, degrees: 0, 0 is AP from below, 90, 0 from the lateral side. The secondary angle tilts the
/// receiver towards the hip.
struct ArmAngles {
  double primary_deg = 0;
  double secondary_deg = 0;
};

struct ViewAngles {
  std::string name;  ///< letters, digits, - and _, at most 32; also the image file's name
  ArmAngles angles;
};

/// NAME:PRIMARY,SECONDARY; anything else is a `usage` failure.
Expected<ViewAngles> view_angles(std::string_view text);

struct SimulationOptions {
  std::uint64_t seed = 1;
  CaseKind kind = CaseKind::accuracy;
  std::optional<Preset> preset = {};  ///< default: flat_panel for kind flat, else ii_9in
  int size = 1024;                    ///< 512 or 1024 pixels a side
  int bits = 12;                      ///< 8, 10, 12, 14 or 16
  bool knee = true;
  std::optional<Response> response = {};       ///< default: logarithmic with the knee, else linear
  std::vector<ViewAngles> views;               ///< 2 to 20; none: AP and LAT with a random positioning error
  std::optional<std::uint64_t> arm_seed = {};  ///< seed of the C-arm itself; default: the case's seed
  /// Instead of udcsc with its check targets; the C-arm and the knee then stand about its balls' centroid.
  std::optional<phantom::Calibrator> calibrator = {};
  std::optional<phantom::Plate> plate = {};  ///< instead of plate48, of an intensifier
  std::shared_ptr<const CtOptions> ct = {};  ///< instead of the modelled knee
  std::vector<Fault> faults;
  std::vector<double> grid_distances_mm = {
      45};                              ///< kind grid: from the receiver to the wires' axes; up to 20
  std::vector<std::string> lost_balls;  ///< labels of balls missing from the calibrator
  unsigned threads = 0;

  bool has(Fault fault) const;
  Preset c_arm_preset() const;
  bool logarithmic() const;
};

}  // namespace helicarm::simulation
