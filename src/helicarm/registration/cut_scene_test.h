// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "helicarm/registration/scene_test.h"

namespace helicarm::registration {

inline constexpr double cut_z = 40;  // of the model; its bone reaches from 7 to 63

/// A registration whose patches agree by 0.7 below the cut, and beyond it as stated for each view.
struct CutScene {
  Model model = *model_from("bone", lopsided_bone(), std::nullopt, HuWindow{150, 3000});
  std::vector<RegistrationView> views = std::vector<RegistrationView>(2);
  Registration found;

  explicit CutScene(std::array<double, 2> beyond) {
    const geometry::RigidTransform pose{Eigen::Matrix3d::Identity(), -model.centre};
    found.world_from_model = pose;
    found.centre = pose * model.centre;
    for (std::size_t i = 0; i < 2; ++i) {
      views[i].view = view_from(i == 0 ? 0 : 80);
      RegisteredView& view = found.views.emplace_back();
      for (double x = -10; x <= 10; x += 4)
        for (double z = 8; z < 68; z += 4) {
          const Eigen::Vector3d at = model.centre + Eigen::Vector3d(x, x, z - model.centre.z());
          view.agreements.push_back({views[i].view.project(pose * at), z < cut_z ? 0.7 : beyond[i], 1});
        }
    }
  }
};

}  // namespace helicarm::registration
