// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "helicarm/operation/plan.h"
#include "helicarm/simulation/simulate_case.h"

namespace helicarm::rehearsal {

struct CtPlanOptions {
  double off_mm = 2, off_deg = 2;  ///< of the registration's start, per axis
  double diameter_mm = 4;          ///< of the tunnels
  bool wrong_bone = false;         ///< the tibia's mask for the femur
};

/// The plan with both bones of the simulated knee as models, instead of its picks: writes a CT of the knee
/// (1 mm voxels, in a frame of its own), the bones' masks and a line between the balls of each tunnel into
/// `folder`.
operation::OperationPlan with_ct_plan(operation::OperationPlan plan,
                                      const simulation::SimulatedCase& simulated,
                                      const std::filesystem::path& folder, const CtPlanOptions& options = {});

}  // namespace helicarm::rehearsal
