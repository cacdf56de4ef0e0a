// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"

namespace helicarm::phantom {

enum class DotKind { balls, holes };
enum class Lattice { square, hexagonal };

/// The rectification plate: dots on a lattice, fixed to the receiver. Plate frame: +x right and +y down seen
/// from the source.
struct Plate {
  std::string name;
  DotKind kind = DotKind::balls;
  Lattice lattice = Lattice::square;
  std::optional<double> pitch_mm;
  double diameter_mm = 2.5;
  std::vector<Eigen::Vector2d> dots_mm;  ///< empty: an unbounded lattice
  std::optional<double> height_above_receiver_mm;
};

/// The built-in plate of the paper's 2.1: 7 x 7 balls of 2.5 mm at 25 mm pitch, without the centre, 15 mm
/// above the receiver.
Plate plate48();

/// Reads plate.json (docs/formats.md). Refuses (bad_value) equal dots, dots more than 0.1 mm off every
/// lattice of the given pitch (at any rotation and shift), and sizes that indicate a wrong unit.
Expected<Plate> read_plate(const std::filesystem::path& path);
Expected<Plate> plate_from_json(const Json& json, const std::string& origin);

/// A built-in plate by name, else the file of that name below `folder` (path_outside if it leads out).
Expected<Plate> plate_named(const std::string& name_or_path, const std::filesystem::path& folder);

/// Inverse of read_plate.
Json to_json(const Plate& plate);

/// Columns: the two basis vectors of a lattice of pitch 1; dots are integer combinations.
Eigen::Matrix2d lattice_steps(Lattice lattice);

/// Largest distance (mm) of a dot from the best-fitting lattice over all rotations and offsets; nothing if
/// above `limit_mm`.
std::optional<double> lattice_misfit(const std::vector<Eigen::Vector2d>& dots_mm, Lattice lattice,
                                     double pitch_mm, double limit_mm);

}  // namespace helicarm::phantom
