// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/read_volume.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/volume/in_memory.h"
#include "helicarm/volume/nifti_header.h"
#include "helicarm/volume/voxels.h"

namespace helicarm::volume {
namespace {

bool is_metaimage(std::string_view bytes) {
  const std::string_view first = trimmed(take_line(bytes)).substr(0, 40);
  return first.starts_with("ObjectType") || first.starts_with("NDims") || first.starts_with("Comment");
}

/// What a file of another kind is, with the way out; empty if it is not known.
std::string_view other_kind(std::string_view bytes) {
  using namespace std::literals;
  if (bytes.size() > 132 && bytes.substr(128, 4) == "DICM")
    return "a DICOM file: give the folder of its series";
  if (bytes.starts_with("II*\0"sv) || bytes.starts_with("MM\0*"sv) || bytes.starts_with("II+\0"sv))
    return "a TIFF file: a stack is read as \"volume\" of a model whose \"voxel_mm\" is given";
  if (bytes.starts_with("\x89PNG") || bytes.starts_with("\xff\xd8\xff")) return "an image, not a volume";
  if (bytes.starts_with("PK\3\4")) return "a ZIP archive: unpack it, and give the volume or folder within";
  if (bytes.starts_with("\x89HDF") || bytes.starts_with("CDF"))
    return "HDF5 or NetCDF (MINC): convert it to NRRD, MetaImage or NIfTI";
  if (bytes.starts_with("BZh") ||
      bytes.starts_with("\xfd"
                        "7zXZ") ||
      bytes.starts_with("\x28\xb5\x2f\xfd"))
    return "a compressed file: decompress it";
  if (bytes.starts_with("# vtk") || bytes.substr(0, 2000).find("<VTKFile") != std::string_view::npos)
    return "a file of VTK: convert it to NRRD, MetaImage or NIfTI; a surface is given as \"surface\"";
  if (bytes.starts_with("solid") || bytes.starts_with("ply"))
    return "a surface: give it as \"surface\" of the model";
  if (bytes.starts_with("\0\0\0\1"sv)) return "a volume of FreeSurfer (MGH): convert it to NIfTI";
  return {};
}

Volume read_file_of_voxels(const std::filesystem::path& path) {
  const std::string bytes = read_volume_file(path);
  if (bytes.starts_with("NRRD000")) return read_nrrd(path, bytes);
  if (is_nifti_header(bytes)) return read_nifti(path, bytes);
  if (is_named_as_voxels(path)) {
    const auto header = *value_or_throw(other_of_pair(path));
    return read_nifti(header, read_volume_file(header));
  }
  if (bytes.starts_with("\x1f\x8b")) return read_nifti(path, bytes);
  if (is_metaimage(bytes)) return read_metaimage(path, bytes);
  if (auto segmentation = read_segmentation(path, bytes)) return *std::move(segmentation);
  const std::string_view kind = other_kind(bytes);
  throw BadInput(Reason::not_an_image,
                 fmt::format("{}: {}neither MetaImage, NRRD, NIfTI nor a folder of DICOM slices",
                             path.string(), kind.empty() ? "" : fmt::format("is {}; ", kind)));
}

}  // namespace

Expected<Volume> read_volume(const std::filesystem::path& path) {
  return guarded([&] {
    std::error_code error;
    Volume volume =
        std::filesystem::is_directory(path, error) ? read_ct_series(path) : read_file_of_voxels(path);
    value_or_throw(check_read(volume, path.string()));
    return volume;
  });
}

Expected<void> check_read(const Volume& volume, const std::string& origin) {
  return check_grid(volume.patient_from_voxel, origin).and_then([&]() -> Expected<void> {
    // Scaling by the file's factor can overflow.
    if (std::ranges::any_of(volume.voxels, [](float voxel) { return !std::isfinite(voxel); }))
      return fail(Reason::not_finite, origin + ": a voxel is not finite");
    return {};
  });
}

}  // namespace helicarm::volume
