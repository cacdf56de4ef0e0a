// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/tiff_stack.h"

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/image/tiff.h"
#include "helicarm/image/tiff_scale.h"
#include "helicarm/volume/declared.h"
#include "helicarm/volume/voxels.h"

namespace helicarm::volume {
namespace {

/// Compares the size of the voxels with what ImageJ wrote of it.
void check_scale(const image::TiffScale& scale, const Eigen::Vector3d& voxel_mm, const std::string& origin,
                 std::vector<Warning>& warnings) {
  const auto unit = unit_in_mm(scale.unit);
  if (!unit) return;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double stated = scale.size[static_cast<std::size_t>(axis)] * *unit;
    if (!(stated > 0) || !differ(stated, voxel_mm[axis], 0.01)) continue;
    warnings.push_back(
        {Reason::irregular_file,
         fmt::format("{}: \"voxel_mm\" is {:g} along {}, but the file's own description states {:g} "
                     "mm: \"voxel_mm\" is used",
                     origin, voxel_mm[axis],
                     axis == 0   ? "x"
                     : axis == 1 ? "y"
                                 : "z",
                     stated)});
  }
}

}  // namespace

bool is_tiff_stack(const std::filesystem::path& path) {
  const std::string extension = small_letters(path.extension().string());
  return extension == ".tif" || extension == ".tiff";
}

Expected<Volume> tiff_stack(const std::filesystem::path& path, const Eigen::Vector3d& voxel_mm,
                            double offset_hu) {
  return guarded([&] {
    const std::string bytes = value_or_throw(read_file(path, max_volume_bytes));
    const std::string origin = path.filename().string();
    const int pages = value_or_throw(image::count_tiff_pages(bytes, origin));
    Volume stack;
    for (int page = 0; page < pages; ++page) {
      const image::GreyImage slice = value_or_throw(image::decode_tiff(bytes, page, origin));
      const Eigen::Vector3i size(slice.pixels.width(), slice.pixels.height(), pages);
      if (page == 0)
        stack.voxels.reserve(value_or_throw(voxel_count(size.cast<double>(), origin)));
      else if (size != stack.size)
        throw BadInput(Reason::bad_size,
                       fmt::format("{}: page {} has {} x {} pixels, the first {} x {}", origin, page + 1,
                                   size.x(), size.y(), stack.size.x(), stack.size.y()));
      stack.size = size;
      if (page == 0 && slice.white_is_zero)
        stack.warnings.push_back(
            {Reason::irregular_file, fmt::format("{}: declares that 0 is white, which is of its display: the "
                                                 "stored values are taken, not inverted",
                                                 origin)});
      for (const std::uint16_t value : slice.pixels.pixels())
        stack.voxels.push_back(static_cast<float>(value + offset_hu));
    }
    stack.patient_from_voxel = Eigen::Scaling(voxel_mm);
    check_scale(image::tiff_scale(path), voxel_mm, origin, stack.warnings);
    return stack;
  });
}

}  // namespace helicarm::volume
