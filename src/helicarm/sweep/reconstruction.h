// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/image/image.h"

namespace helicarm::sweep {

/// A small volume about a target, x fastest, cubic voxels.
struct Reconstruction {
  std::array<int, 3> size{0, 0, 0};
  double voxel_mm = 1;
  std::vector<float> values;

  float at(int x, int y, int z) const {
    return values[std::size_t(x) +
                  std::size_t(size[0]) * (std::size_t(y) + std::size_t(size[1]) * std::size_t(z))];
  }
};

/// plastimatch's `fdk` of a folder of img_0000.pfm with img_0000.txt and so on, about the origin. Refuses
/// missing_file where there is no such program, unsupported where it fails.
Expected<Reconstruction> reconstruct(const std::string& program, const std::filesystem::path& folder,
                                     const std::array<int, 3>& size, double voxel_mm);

/// First line that the program prints of its version; missing_file where there is no such program.
Expected<std::string> version_of(const std::string& program);

/// Width at half maximum: diameter of the ball that spreads as the voxels above half of the contrast do, by
/// their second moments; so what is doubled or bent is wide. `nominal_mm`: the ball's diameter. Nothing where
/// nothing stands out of the noise.
std::optional<double> ball_width_mm(const Reconstruction& volume, double nominal_mm);

/// Likewise of a wire along z: diameter of the circle that spreads as much, mean of the slices.
std::optional<double> wire_width_mm(const Reconstruction& volume);

/// The middle slice across z for display; white: the volume's highest value.
image::Image<std::uint8_t> middle_slice(const Reconstruction& volume);

}  // namespace helicarm::sweep
