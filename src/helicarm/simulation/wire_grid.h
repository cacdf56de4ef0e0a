// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/simulation/scene.h"
#include "helicarm/simulation/truth.h"

namespace helicarm::simulation {

/// The test grid of 3.1: steel wires each way, all axes in one plane, parallel to the receiver. In the grid's
/// frame the crosses lie at (i, j, 0) pitches, i and j from -4 to 4; +x right and +y down seen from the
/// source, z towards the receiver.
struct WireGrid {
  int wires = 9;
  double pitch_mm = 20;
  double thickness_mm = 1;
};

/// The wires, half a pitch longer at each end than their last crosses; in the grid's frame.
Scene wire_grid_body(const WireGrid& grid);

/// Where the crosses are truly seen, called "i,j", row by row; `scene` is what was rendered, world = grid.
std::vector<TruePoint> grid_crosses(const WireGrid& grid, const Scene& scene, const TrueView& true_view);

/// The plate alone and then, for each distance from the receiver, with the grid before it: all by the C-arm
/// as it stands for the seed's AP view. The grid is laid on by hand: turned by up to 2 degrees and shifted by
/// up to 3 mm from the receiver's middle. World = grid; of the first acquisition, the grid at the first
/// distance.
std::vector<TrueView> take_grid_stand(const SimulationOptions& options, double plate_height_mm);

}  // namespace helicarm::simulation
