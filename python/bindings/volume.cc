// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/volume.h"

#include <algorithm>
#include <array>
#include <memory>

#include "arrays.h"
#include "checks.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/image/grey_image.h"
#include "helicarm/volume/declared.h"
#include "helicarm/volume/drr.h"
#include "helicarm/volume/hounsfield.h"
#include "helicarm/volume/in_memory.h"
#include "helicarm/volume/read_volume.h"
#include "module.h"

namespace helicarm::python {
namespace {

using volume::Volume;
using VoxelArray = py::array_t<float, py::array::f_style | py::array::forcecast>;
constexpr std::array<std::string_view, 2> value_words{"hu", "raw"};

/// 3 x 4 or 4 x 4, to L, P, S.
Eigen::Affine3d affine_from(const Doubles& stated, const std::string& frame) {
  const py::ssize_t rows = stated.ndim() == 2 && stated.shape(0) == 3 ? 3 : 4;
  const Eigen::MatrixXd matrix = matrix_of(stated, rows, 4, "affine");
  if (rows == 4 && matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    raise({Reason::bad_value, "affine: the last row is not 0 0 0 1", {}, {}});
  const Eigen::Vector3d signs =
      value_or_raise(guarded([&] { return volume::declared_space(frame, "frame"); }));
  Eigen::Affine3d affine = Eigen::Affine3d::Identity();
  affine.matrix().topRows<3>() = signs.asDiagonal() * matrix.topRows<3>();
  return affine;
}

std::shared_ptr<Volume> volume_from(const py::object& given, const Doubles& affine,
                                    const std::string& frame) {
  const py::array array = plain_array(given, "array");
  if (array.ndim() != 3)
    raise({Reason::bad_size, fmt::format("array: shape {} is not (i, j, k)", shape_of(array)), {}, {}});
  auto loaded = std::make_shared<Volume>();
  for (int axis = 0; axis < 3; ++axis) loaded->size[axis] = int(array.shape(axis));
  const std::size_t count = value_or_raise(volume::voxel_count(loaded->size.cast<double>(), "array"));
  loaded->patient_from_voxel = affine_from(affine, frame);
  const VoxelArray voxels = VoxelArray::ensure(array);
  if (!voxels) raise({Reason::bad_value, "array: its elements are not real numbers", {}, {}});
  loaded->voxels.assign(voxels.data(), voxels.data() + count);
  const auto bad = std::ranges::find_if(loaded->voxels, [](float voxel) { return !std::isfinite(voxel); });
  if (bad != loaded->voxels.end()) {
    const auto at = std::size_t(bad - loaded->voxels.begin());
    const auto ni = std::size_t(loaded->size.x()), nj = std::size_t(loaded->size.y());
    raise({Reason::not_finite,
           fmt::format("array: [{}, {}, {}] is {}: numpy.nan_to_num(array, nan=-1000) makes air of what is "
                       "not a number",
                       at % ni, at / ni % nj, at / ni / nj, *bad),
           {},
           {}});
  }
  value_or_raise(volume::check_read(*loaded, "Volume"));
  return loaded;
}

py::array array_of(const py::object& self) {
  const auto& held = self.cast<const Volume&>();
  const auto [nx, ny, nz] =
      std::array{py::ssize_t(held.size.x()), py::ssize_t(held.size.y()), py::ssize_t(held.size.z())};
  const py::ssize_t each = sizeof(float);
  return read_only(
      py::array_t<float>({nx, ny, nz}, {each, each * nx, each * nx * ny}, held.voxels.data(), self));
}

py::array drrs(const Volume& held, const std::vector<exchange::ImportedMatrix>& cameras,
               std::pair<int, int> shape, const std::string& values, unsigned threads) {
  const bool is_hu = checked_word(values, value_words, "values") == 0;
  if (is_hu) warn(value_or_raise(volume::check_hounsfield(held, "volume")));
  const auto [height, width] = shape;
  for (const int side : {height, width})
    if (side < 1 || side > int(image::max_image_side))
      raise({Reason::bad_size,
             fmt::format("shape: a side of {} pixels, must be 1 to {}", side, image::max_image_side),
             {},
             {}});
  py::array_t<float> images({py::ssize_t(cameras.size()), py::ssize_t(height), py::ssize_t(width)});
  float* at = images.mutable_data();
  value_or_raise(without_gil([&] {
    return guarded([&] {
      const volume::Absorber absorber(held, is_hu ? volume::attenuation_from_hu : volume::Ramp{}, threads);
      for (const exchange::ImportedMatrix& camera : cameras) {
        const auto image = value_or_throw(volume::drr(absorber, camera.view, width, height, threads));
        at = std::ranges::copy(image.pixels(), at).out;
      }
    });
  }));
  return images;
}

}  // namespace

void add_volume(py::module_& module) {
  py::class_<Volume, std::shared_ptr<Volume>>(module, "Volume", R"(A CT or another voxel volume in memory.

Volume(array, affine, *, frame)
  array: (ni, nj, nk) indexed [i, j, k], real numbers without a mask, Hounsfield units in a CT; converted to float32 by one copy
  affine: (4, 4) or (3, 4): voxel index (i, j, k) to mm; integers are voxel centres. A shear such as a gantry tilt is kept
  frame: of affine: "LPS" (DICOM, ITK), "RAS" (NIfTI, 3D Slicer) or another patient space; LPS inside
Raises InputError: bad_size, bad_value (singular, nearly coplanar axes, spacing outside 0.001 to 100 mm), not_finite,
unsupported (another frame). as_volume takes objects of other packages, read_volume files.)")
      .def(py::init(&volume_from), py::arg("array"), py::arg("affine"), py::kw_only(), py::arg("frame"))
      .def_property_readonly("array", &array_of, "(ni, nj, nk) float32, read only, not copied.")
      .def_property_readonly(
          "affine", [](const Volume& v) { return read_only(matrix_array(v.patient_from_voxel.matrix())); },
          "(4, 4): voxel index (i, j, k) to L, P, S, mm.")
      .def_property_readonly(
          "shape", [](const Volume& v) { return std::tuple(v.size.x(), v.size.y(), v.size.z()); },
          "(ni, nj, nk)")
      .def_property_readonly(
          "centre_mm", [](const Volume& v) { return read_only(rows_array<3>({v.centre()}, true)); },
          "(3,) L, P, S.")
      .def_property_readonly("warnings", [](const Volume& v) { return warning_list(v.warnings); })
      .def(py::pickle(
          [](const py::object& self) {
            const auto& held = self.cast<const Volume&>();
            return py::make_tuple(array_of(self), matrix_array(held.patient_from_voxel.matrix()),
                                  warning_list(held.warnings));
          },
          [](const py::tuple& state) {
            auto loaded = volume_from(state[0].cast<py::array>(), state[1].cast<Doubles>(), "LPS");
            loaded->warnings = warnings_from(state[2].cast<py::list>());
            return loaded;
          }))
      .def("__repr__", [](const Volume& v) {
        return fmt::format("<Volume: {} x {} x {} voxels>", v.size.x(), v.size.y(), v.size.z());
      });
  module.def(
      "read_volume",
      [](const std::filesystem::path& path) {
        return std::make_shared<Volume>(
            value_or_raise(without_gil([&] { return volume::read_volume(path); })));
      },
      py::arg("path"),
      R"(Reads MetaImage, NRRD, NIfTI, or a folder of DICOM CT slices. Releases the GIL. Returns a Volume.

Raises InputError: missing_file, not_an_image, truncated, bad_size, bad_value, unsupported, not_finite.)");
  module.def("_volume_of_slices", [](const std::vector<std::string>& files, const std::string& origin) {
    return std::make_shared<Volume>(
        value_or_raise(without_gil([&] { return volume::volume_of_slices(files, origin); })));
  });
  module.def("_volume_of_nifti", [](const std::string& bytes, const std::string& origin) {
    return std::make_shared<Volume>(
        value_or_raise(without_gil([&] { return volume::volume_of_nifti(bytes, origin); })));
  });
  module.def("_drr", &drrs, py::arg("volume"), py::arg("cameras"), py::arg("shape"), py::arg("values"),
             py::arg("threads"));
}

}  // namespace helicarm::python
