// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/registration/model.h"
#include "helicarm/registration/surface.h"
#include "helicarm/volume/volume.h"

namespace helicarm::registration {

/// Where a line crosses the bone's surface.
struct Crossing {
  double at_mm = 0;                                  ///< along the line from its origin
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< of the surface, outward, unit
  bool leaves = false;                               ///< the bone; otherwise the line enters it
};

/// The outer surface of a bone in model coordinates (mm): cavities, such as marrow below a window, belong to
/// the bone. Where the bone goes on beyond its volume it is continued, and has no surface there.
class BoneSurface {
 public:
  virtual ~BoneSurface() = default;

  /// Of the line from `origin` along the unit vector, up to this length, in order; not more than `most`.
  virtual std::vector<Crossing> crossings(
      const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double length_mm,
      std::size_t most = std::numeric_limits<std::size_t>::max()) const = 0;
  virtual bool holds(const Eigen::Vector3d& point) const = 0;
  /// False: the place is beyond the part of the CT about the bone; bone there is continued from its face.
  virtual bool shows(const Eigen::Vector3d& point) const = 0;
  /// Standard deviation along its normal of the surface at this place on it, mm.
  virtual double sigma_mm(const Eigen::Vector3d& point) const = 0;
};

/// Of a CT with a mask or a window, by `volume::bone_edge`. A window's gaps of up to 2 mm are closed. Volume
/// and mask as accepted by `model_from`.
std::shared_ptr<const BoneSurface> bone_surface(const volume::Volume& volume,
                                                const std::optional<volume::Volume>& mask,
                                                const std::optional<HuWindow>& window);

/// Of a closed surface; shells inside it are left out. `voxel_mm`: as `Model::voxel_mm`.
std::shared_ptr<const BoneSurface> bone_surface(const Surface& surface, double voxel_mm);

}  // namespace helicarm::registration
