// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/registration/density.h"
#include "helicarm/registration/surface.h"
#include "helicarm/volume/volume.h"

namespace helicarm::registration {

/// A rigid body to be registered. Model coordinates: the volume's patient frame or the surface file's own,
/// mm.
struct Model {
  std::string name;
  Density density;                    ///< of a surface: 1 inside
  std::optional<Surface> surface;     ///< then the contour decides
  bool outlined = true;               ///< by a mask or a surface; otherwise a threshold decides where it ends
  std::vector<Eigen::Vector3d> cuts;  ///< where the body goes on beyond the volume
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> samples;  ///< points spread over the body
  double radius_mm = 0;                  ///< rms distance of the samples from the centre
  double resolution_mm = 0;              ///< of the density's voxels
  double voxel_mm = 0;                   ///< about, of a surface made from a mask; 0: another body
  std::vector<Warning> warnings = {};    ///< of its files
};

/// Hounsfield units taken as the body; values above the upper limit count as the limit.
struct HuWindow {
  double low = 150;
  double high = 3000;
};

/// Refuses (bad_value) a mask on another grid than the volume's, one of which less than 5 % is 0, as of a CT,
/// an empty one, and one within which nothing is denser than soft tissue; `name` begins the message.
Expected<void> check_mask(const std::string& name, const volume::Volume& volume, const volume::Volume& mask);

/// A body from a CT. With a mask (same grid; non-zero: inside) or a window its density is the excess over
/// soft tissue, which surrounds it in the image; without either the attenuation of everything. Refuses
/// (bad_value) a model without voxels, and as `check_mask`.
Expected<Model> model_from(const std::string& name, const volume::Volume& volume,
                           const std::optional<volume::Volume>& mask, const std::optional<HuWindow>& window);

/// A body from a closed surface; steps of one made from a mask are smoothed. Fails as `prepare_surface`.
Expected<Model> model_from(const std::string& name, phantom::TriangleMesh mesh);

/// Root mean square distance (mm) between the samples at two poses.
double separation(const Model& model, const geometry::RigidTransform& a, const geometry::RigidTransform& b);

}  // namespace helicarm::registration
