// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"

namespace helicarm {

enum class DotKind { balls, holes };
enum class Lattice { square, hexagonal };

/// The rectification plate: dots on a lattice, fixed to the receiver. In its own plane, +x right and +y down as seen
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

/// The built-in plate of the paper's 2.1: 7 x 7 balls of 2.5 mm at 25 mm, the centre missing, 15 mm above the receiver.
Plate plate48();

Expected<Plate> read_plate(const std::filesystem::path& path);

}  // namespace helicarm
