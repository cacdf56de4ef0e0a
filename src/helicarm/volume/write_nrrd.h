// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace helicarm::volume {

/// A NRRD of bytes, gzip, in L, P, S and mm, x fastest; `values` has a byte for each voxel.
std::string to_nrrd(const Eigen::Vector3i& size, const Eigen::Affine3d& patient_from_voxel,
                    std::span<const std::uint8_t> values);

}  // namespace helicarm::volume
