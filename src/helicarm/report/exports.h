// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/pipeline/result.h"
#include "helicarm/xray/write_dicom.h"

namespace helicarm::report {

/// Export formats: table of points, 3D Slicer markups, MayaCam 2.0 per view, DLT coefficients of the views,
/// 3x4 matrix per view, rectified image per view as DICOM, camera of OpenCV, RTK and as ITK transform per
/// view, and on request all views in one file for reconstruction (docs/formats.md).
enum class Export {
  csv,
  slicer,
  mayacam,
  dlt,
  matrix,
  images,
  opencv,
  rtk,
  itk,
  tigre,
  astra,
  leap,
  plastimatch,
  diffdrr,
  deepdrr,
  ompl,
  npy
};

inline constexpr std::array every_export{Export::csv,    Export::slicer, Export::mayacam,
                                         Export::dlt,    Export::matrix, Export::images,
                                         Export::opencv, Export::rtk,    Export::itk};
inline constexpr std::array<std::string_view, every_export.size()> export_words{
    "csv", "slicer", "mayacam", "dlt", "matrix", "images", "opencv", "rtk", "itk"};

/// Written on request only: a reconstruction program takes one of them.
inline constexpr std::array requested_export{Export::tigre,       Export::astra,   Export::leap,
                                             Export::plastimatch, Export::diffdrr, Export::deepdrr,
                                             Export::ompl,        Export::npy};
inline constexpr std::array<std::string_view, requested_export.size()> requested_words{
    "tigre", "astra", "leap", "plastimatch", "diffdrr", "deepdrr", "ompl", "npy"};

/// The formats with these words; none: `every_export`. Fails with usage for another word.
Expected<std::vector<Export>> exports_named(const std::vector<std::string>& words);

/// An object at whose depth the Pixel Spacing of rectified images holds.
struct SpacingObject {
  std::string name;
  Eigen::Vector3d at;  ///< calibrator's frame at the first acquisition, mm
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  /// Of its tracked bone in the calibrator's frame, from the first acquisition to each view's; empty: none.
  std::vector<geometry::RigidTransform> motions = {};
};

/// Pixel Spacing at the object's depth in each calibrated view at its acquisition, by the view's index;
/// refuses `behind_source`,
/// naming the view.
Expected<std::map<std::size_t, xray::ObjectSpacing>> spacings_at(const pipeline::Result& result,
                                                                 const SpacingObject& object);

/// A sentence on how far pixels lie off in the files of TIGRE and LEAP, which have one pixel size for all
/// views; empty without these files, and below 0.01 px.
std::string one_pixel_size_note(const pipeline::Result& result, std::span<const Export> kinds);

/// Removes the files of an earlier export, recognised by name and content.
void forget_exports(const std::filesystem::path& folder);

/// Writes the available parts of a result into `folder`, which then holds no file of an earlier export, and
/// returns the files' paths; all files or none. Refuses with the result's own failure, `point_at_infinity`
/// for a view without DLT coefficients, `name_clash` if two views would share a file, `cannot_write`; where
/// not all formats are written, also what RTK, TIGRE or LEAP cannot represent (`unsupported`,
/// `behind_source`). `object`:
/// the rectified images have the Pixel Spacing of its depth; refuses as `spacings_at`.
Expected<std::vector<std::filesystem::path>> write_exports(const pipeline::Result& result,
                                                           const std::filesystem::path& folder,
                                                           std::span<const Export> kinds = every_export,
                                                           const std::optional<SpacingObject>& object = {});

}  // namespace helicarm::report
