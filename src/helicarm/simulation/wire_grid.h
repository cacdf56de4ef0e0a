// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/simulation/scene.h"
#include "helicarm/simulation/truth.h"

namespace helicarm::simulation {

/// The test grid of 3.1: steel wires in both directions, all axes in one plane parallel to the receiver. In
/// the grid's frame the crosses are at (i, j, 0) pitches, i and j from -4 to 4; +x right and +y down seen
/// from the source, z towards the receiver.
struct WireGrid {
  int wires = 9;
  double pitch_mm = 20;
  double thickness_mm = 1;
};

/// The wires, extended by half a pitch beyond their last crosses; in the grid's frame.
Scene wire_grid_body(const WireGrid& grid);

/// True images of the crosses, named "i,j", row by row; `scene` is the rendered scene, world = grid.
std::vector<TruePoint> grid_crosses(const WireGrid& grid, const Scene& scene, const TrueView& true_view);

/// The plate alone and then, for each distance from the receiver, with the grid in front of it, at the C-arm
/// pose of the seed's AP view. The grid is positioned manually: rotated by up to 2 degrees and shifted by up
/// to 3 mm from the receiver's centre. World = grid; for the first acquisition, the grid at the first
/// distance.
std::vector<TrueView> take_grid_stand(const SimulationOptions& options, double plate_height_mm);

}  // namespace helicarm::simulation
