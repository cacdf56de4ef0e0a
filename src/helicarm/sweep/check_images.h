// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/image/image.h"
#include "helicarm/sweep/check_boxes.h"
#include "helicarm/sweep/sweep_case.h"

namespace helicarm::sweep {

/// The filter runs along rows, so rows are made to lie across the axis, and columns not mirrored.
struct Upright {
  bool transposed = false;

  geometry::View operator()(geometry::View view) const;
  image::Image<float> operator()(image::Image<float> image) const;
};
Upright upright_of(const Sweep& sweep, const Cameras& own);

/// Rows of the images that hold a target in every geometry: of each image the first, and their number.
struct Rows {
  std::vector<int> first;
  int count = 0;
};

/// `boxes`: of the target, in each geometry; `height` of the upright images.
Rows rows_of(const std::vector<CheckBox>& boxes, const std::vector<Cameras>& geometries,
             const Upright& upright, int height);

/// Of the i-th used frame, as plastimatch looks for it.
std::string frame_name(std::size_t i, const char* ending);

/// Throws `cannot_write`.
void write_bytes(const std::filesystem::path& file, std::string_view head, std::string_view body);

/// Of each of these frames the attenuation in the rows of each target, in the target's folder: 0, 1, ...
void write_images(const SweepCase& the_case, const std::vector<std::size_t>& frames, const Upright& upright,
                  const std::vector<Rows>& rows, const std::filesystem::path& folder, unsigned threads,
                  const std::function<void()>& done);

}  // namespace helicarm::sweep
