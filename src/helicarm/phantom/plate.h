// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"

namespace helicarm {

enum class DotKind { balls, holes };
enum class Lattice { square, hexagonal };

/// The rectification plate: dots on a lattice, fixed to the receiver. In its own plane, +x right and +y down
/// as seen from the source.
struct Plate {
  std::string name;
  DotKind kind = DotKind::balls;
  Lattice lattice = Lattice::square;
  std::optional<double> pitch_mm;
  double diameter_mm = 2.5;
  std::vector<Eigen::Vector2d> dots_mm;  ///< empty: an unbounded lattice
  std::optional<double> height_above_receiver_mm;
};

/// The built-in plate of the paper's 2.1: 7 x 7 balls of 2.5 mm at 25 mm, the centre missing, 15 mm above the
/// receiver.
Plate plate48();

/// plate.json as docs/formats.md describes it. Refuses (bad_value) equal dots, dots more than 0.1 mm off
/// every lattice of the given pitch (however turned and shifted), and sizes that betray a wrong unit.
Expected<Plate> read_plate(const std::filesystem::path& path);
Expected<Plate> plate_from_json(const Json& json, const std::string& origin);

/// A built-in by its name, else the file of that name below `folder` (path_outside where it leads out of it).
Expected<Plate> plate_named(const std::string& name_or_path, const std::filesystem::path& folder);

/// What read_plate reads.
Json to_json(const Plate& plate);

/// Columns: the two steps of a lattice of pitch 1, so that its dots lie at integer combinations of them.
Eigen::Matrix2d lattice_steps(Lattice lattice);

/// Greatest distance (mm) of a dot from the nearest point of the lattice that fits all dots best, whatever
/// its turn and offset; at most `limit_mm`, else nothing.
std::optional<double> lattice_misfit(const std::vector<Eigen::Vector2d>& dots_mm, Lattice lattice,
                                     double pitch_mm, double limit_mm);

}  // namespace helicarm
