// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/read_volume.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/volume/voxels.h"

namespace helicarm::volume {
namespace {

bool is_metaimage(std::string_view bytes) {
  const std::string_view first = trim(take_line(bytes)).substr(0, 40);
  return first.starts_with("ObjectType") || first.starts_with("NDims") || first.starts_with("Comment");
}

bool is_nifti(std::string_view bytes) {
  return bytes.starts_with("\x1f\x8b") || (bytes.size() >= 8 && bytes.substr(4, 3) == "n+2") ||
         (bytes.size() >= 348 && (bytes.substr(344, 3) == "n+1" || bytes.substr(344, 3) == "ni1"));
}

Volume read_file_of_voxels(const std::filesystem::path& path) {
  const std::string bytes = read_volume_file(path);
  if (bytes.starts_with("NRRD000")) return read_nrrd(path, bytes);
  if (is_nifti(bytes)) return read_nifti(path, bytes);
  if (is_metaimage(bytes)) return read_metaimage(path, bytes);
  throw BadInput(
      Reason::not_an_image,
      fmt::format("{}: neither MetaImage, NRRD, NIfTI-1 nor a folder of DICOM slices", path.string()));
}

}  // namespace

Expected<Volume> read_volume(const std::filesystem::path& path) {
  return guarded([&] {
    std::error_code error;
    Volume volume =
        std::filesystem::is_directory(path, error) ? read_ct_series(path) : read_file_of_voxels(path);
    value_or_throw(check_grid(volume.patient_from_voxel, path.string()));
    // Scaling by the file's factor can overflow.
    if (std::ranges::any_of(volume.voxels, [](float voxel) { return !std::isfinite(voxel); }))
      throw BadInput(Reason::not_finite, path.string() + ": a voxel is not finite");
    return volume;
  });
}

}  // namespace helicarm::volume
