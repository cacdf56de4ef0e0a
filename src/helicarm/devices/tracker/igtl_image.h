// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include <Eigen/Core>

#include "helicarm/devices/tracker/igtl_message.h"

namespace helicarm::tracker {

/// A grey image in a plane of space, mm.
struct PlacedImage {
  std::span<const std::uint16_t> pixels;  ///< by rows
  int width = 0;
  int height = 0;
  Eigen::Vector3d column_step = Eigen::Vector3d::UnitX();  ///< from a pixel to its right neighbour
  Eigen::Vector3d row_step = Eigen::Vector3d::UnitY();     ///< from a pixel to the one below
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();        ///< of the image
};

/// OpenIGTLink's IMAGE, version 1 of its format: one component of 16 bits, one slice, coordinates RAS. Throws
/// std::invalid_argument where the size is not 1 to 65,535 a side or not that of the pixels.
IgtlMessage image_message(const std::string& device, const PlacedImage& image);

}  // namespace helicarm::tracker
