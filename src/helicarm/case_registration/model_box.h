// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/registration/landmarks.h"
#include "helicarm/registration/model.h"

namespace helicarm::case_registration {

/// Where the points of a model can be: the box of its mask, window, volume or surface.
struct ModelBox {
  Eigen::Affine3d model_from_box = Eigen::Affine3d::Identity();
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();
  double near_mm = 10;           ///< outside, not yet warned of
  bool refuses = true;           ///< what is farther outside than the box is large
  std::string what = "its box";  ///< for messages

  double largest_side_mm() const;
  double distance_mm(const Eigen::Vector3d& in_model) const;  ///< 0 inside
};

ModelBox box_of(const registration::Model& model);
/// Of landmarks alone: points as far outside as they are apart are ordinary.
ModelBox box_of(const std::vector<registration::Landmark>& landmarks);

struct PlacedPoint {
  std::string name;
  Eigen::Vector3d in_model;
};

/// Points of a file (`origin`) against the model's box: farther outside than the box is large throws BadInput
/// (bad_value), over 10 mm outside is a warning (outside_model). Asks for RAS, cm or m where the points, so
/// read, lie inside.
std::vector<Warning> check_places(const std::string& model, const std::string& origin, const ModelBox& box,
                                  const std::vector<PlacedPoint>& points);

}  // namespace helicarm::case_registration
