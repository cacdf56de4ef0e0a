// SPDX-License-Identifier: Apache-2.0
#include <limits>
#include <memory>

#include "arrays.h"
#include "checks.h"
#include "helicarm/core/files.h"
#include "helicarm/core/parallel.h"
#include "helicarm/image/grey_image.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/rectification/models/polynomial.h"
#include "helicarm/rectification/pixel_map.h"
#include "helicarm/rectification/rectify.h"
#include "helicarm/xray/dicom_acquisition.h"
#include "module.h"
#include "options.h"

namespace helicarm::python {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// NaN where the map leads off the image.
template <class Carry>
py::array carried(const rectification::DistortionMap& map, const Doubles& points, Carry carry) {
  constexpr std::size_t worth_threads = 1000;
  auto rows = rows_of<2>(points, "uv");
  without_gil([&] {
    parallel_for(rows.size(), rows.size() < worth_threads ? 1 : 0, [&](std::size_t i) {
      rows[i] = carry(map, rows[i]).value_or(Eigen::Vector2d::Constant(nan));
    });
  });
  return rows_array<2>(rows, points.ndim() == 1);
}

py::object sigmas(const rectification::DistortionMap& map, const Doubles& points) {
  const auto rows = rows_of<2>(points, "uv");
  if (points.ndim() == 1) return py::float_(map.sigma_px(rows[0]));
  py::array_t<double> sigma(py::ssize_t(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) sigma.mutable_at(i) = map.sigma_px(rows[i]);
  return sigma;
}

py::array rectified_pixels(const rectification::DistortionMap& map, const xray::XrayImage& image) {
  if (image.pixels.width() != map.width || image.pixels.height() != map.height)
    raise({Reason::bad_size,
           fmt::format("the image has {} x {} pixels, the map is for {} x {}", image.pixels.width(),
                       image.pixels.height(), map.width, map.height),
           {},
           {}});
  return moved_to_array(without_gil([&] { return rectification::resample(image, map); }));
}

rectification::DistortionMap identity(int width, int height, std::optional<double> pixel_mm) {
  constexpr Limits sides{1, image::max_image_side};
  checked(double(width), sides, "width");
  checked(double(height), sides, "height");
  return rectification::identity_map(width, height,
                                     checked(pixel_mm, {xray::min_pixel_mm, xray::max_pixel_mm}, "pixel_mm"));
}

rectification::DistortionMap of_xmalab(const std::filesystem::path& raw,
                                       const std::filesystem::path& undistorted,
                                       const std::pair<int, int>& shape,
                                       const std::optional<std::string>& model) {
  constexpr Limits sides{1, image::max_image_side};
  checked(double(shape.first), sides, "shape");
  checked(double(shape.second), sides, "shape");
  return value_or_raise(without_gil([&] {
    return rectification::read_xmalab_grid(raw, undistorted).and_then([&](const auto& grid) {
      return rectification::fit_pixel_map(grid, shape.second, shape.first, {{}, model.value_or("")})
          .map([](rectification::MapFit fit) { return std::move(fit.map); });
    });
  }));
}

using GivenPlate = std::variant<phantom::Plate, std::filesystem::path>;

phantom::Plate plate_of(const GivenPlate& given) {
  if (const auto* plate = std::get_if<phantom::Plate>(&given)) return *plate;
  const auto& path = std::get<std::filesystem::path>(given);
  if (phantom::Plate built_in = phantom::plate48(); path == built_in.name) return built_in;
  return value_or_raise(phantom::read_plate(path).map_error([](Failure failure) {
    if (failure.reason == Reason::missing_file)
      failure.message += fmt::format("; the built-in plate is \"{}\"", phantom::plate48().name);
    return failure;
  }));
}

rectification::DistortionMap loaded(const std::filesystem::path& path) {
  return value_or_raise(
      rectification::distortion_map_from_json(value_or_raise(read_json(path)), path.filename().string()));
}

rectification::Rectification rectified(const xray::XrayImage& image, const GivenPlate& plate,
                                       const std::string& method, const std::optional<std::string>& model) {
  const rectification::RectificationOptions options{method_of(method), {}, model.value_or("")};
  const phantom::Plate given = plate_of(plate);
  auto found = without_gil([&] { return rectification::rectify(image, given, options); });
  if (!found) found.error().view = image.name;
  return value_or_raise(std::move(found));
}

py::array dots(const rectification::Rectification& r) {
  std::vector<Eigen::Vector2d> rows;
  for (const detection::Dot& dot : r.plate_dots) rows.push_back(dot.centre_px);
  return read_only(rows_array<2>(rows));
}

}  // namespace

rectification::Method method_of(const std::string& word) {
  return rectification::Method(checked_word(word, rectification::method_words, "method"));
}

namespace {

void add_attributes(py::class_<rectification::DistortionMap>& map_class) {
  map_class
      .def_property_readonly("model",
                             [](const rectification::DistortionMap& map) { return map.model->name(); })
      .def_property_readonly(
          "order",
          [](const rectification::DistortionMap& map) {
            const auto* polynomial = dynamic_cast<const rectification::PolynomialModel*>(map.model.get());
            return polynomial ? polynomial->order() : 0;
          },
          "Order of the polynomial; 0: there is none.")
      .def_readonly("residual_rms_px", &rectification::DistortionMap::residual_rms_px)
      .def_readonly("residual_max_px", &rectification::DistortionMap::residual_max_px)
      .def_readonly("held_out_rms_px", &rectification::DistortionMap::held_out_rms_px)
      .def_readonly("rectified_pixel_mm", &rectification::DistortionMap::rectified_pixel_mm, "mm, or None.")
      .def_property_readonly(
          "rectified_plane",
          [](const rectification::DistortionMap& map) -> std::optional<std::string> {
            if (!map.rectified_plane) return std::nullopt;
            return map.rectified_plane == rectification::RectifiedPlane::detector ? "detector" : "plate";
          },
          "Plane of rectified_pixel_mm: \"detector\", \"plate\" or None.")
      .def_property_readonly(
          "shape", [](const rectification::DistortionMap& map) { return std::pair(map.height, map.width); },
          "(height, width) of the image it belongs to.")
      .def("__repr__", [](const rectification::DistortionMap& map) {
        return fmt::format("<DistortionMap {}: {} x {} pixels>", map.model->name(), map.width, map.height);
      });
}

void add_distortion_map(py::module_& module) {
  py::class_<rectification::DistortionMap> map_class(
      module, "DistortionMap",
      R"(Raw pixels of an image to rectified ones, and back (Eq. 1).

Both directions agree: one is the numerical inverse of the other. Rectified pixels have the raw scale and no rotation at
the image centre. Points are (u, v) in pixels; (0, 0) is the centre of the top-left pixel.)");
  map_class
      .def_static(
          "identity", &identity, py::arg("width"), py::arg("height"), py::arg("pixel_mm") = py::none(),
          "The map of a flat panel, without distortion. pixel_mm: detector pixel, 0.01 to 2 mm, or None.")
      .def_static("from_xmalab", &of_xmalab, py::arg("raw"), py::arg("undistorted"), py::kw_only(),
                  py::arg("shape"), py::arg("model") = py::none(),
                  R"(Of the dots of XMALab's grid, as `helicarm rectify --xmalab`.

raw, undistorted: NAME_INPTS.csv and NAME_BSPTS.csv, as XMALab exports them with its look-up table. shape: (height, width)
of the image. model: as rectify's. Rectified pixels are those of XMALab's undistorted image. Releases the GIL.
Raises InputError: bad_size where the files' numbers of dots differ, bad_value; RefusedError where no map fits.)")
      .def_static("load", &loaded, py::arg("path"), "Reads map.json. Raises InputError.")
      .def_static(
          "from_dict",
          [](const py::object& dict) {
            return value_or_raise(rectification::distortion_map_from_json(json_from(dict), "dict"));
          },
          py::arg("dict"), "From the content of map.json. Raises InputError.")
      .def(
          "save",
          [](const rectification::DistortionMap& map, const std::filesystem::path& path) {
            value_or_raise(write_file(path, to_text(rectification::to_json(map)) + "\n"));
          },
          py::arg("path"),
          "Writes map.json, which load reads back to the last bit. Raises InputError: cannot_write.")
      .def(
          "to_dict",
          [](const rectification::DistortionMap& map) { return python_from(rectification::to_json(map)); },
          "The content of map.json.")
      .def(
          "rectified_from_raw",
          [](const rectification::DistortionMap& map, const Doubles& uv) {
            return carried(map, uv, rectification::rectified_in_image);
          },
          py::arg("uv"), R"((N, 2) or (2,) raw pixels to rectified ones, same shape; many points on all cores.

NaN for points off the image and where the map folds: it is not extrapolated. Releases the GIL.
Raises InputError: bad_value for another shape, not_finite.)")
      .def(
          "raw_from_rectified",
          [](const rectification::DistortionMap& map, const Doubles& uv) {
            return carried(map, uv, rectification::raw_in_image);
          },
          py::arg("uv"),
          "(N, 2) or (2,) rectified pixels to raw pixels: the inverse of rectified_from_raw, with the same "
          "shapes, NaN and errors.")
      .def("rectify_image", &rectified_pixels, py::arg("image"),
           R"(An XrayImage resampled to rectified pixels (Eq. 3): (height, width) float32, same size.

Outside the raw image it holds the lowest grey value. The array owns its pixels. Releases the GIL.
Raises InputError: bad_size where the map is for another image size.)")
      .def("sigma_px", &sigmas, py::arg("uv"),
           "Standard deviation per axis of the map itself at rectified pixels: (N,) of (N, 2), a number of "
           "(2,).")
      .def(
          "covariance_px2",
          [](const rectification::DistortionMap& map, const Doubles& uv) {
            const auto rows = rows_of<2>(uv, "uv");
            return matrix_array(without_gil([&] { return map.covariance_px2(rows); }));
          },
          py::arg("uv"),
          R"((N, N) covariance per axis (px^2) of the map among (N, 2) rectified pixels: neighbours err alike.

Its diagonal is sigma_px squared. For ViewPoints(map_covariance_px2=...). Releases the GIL.)");
  add_attributes(map_class);
}

}  // namespace

void add_rectification(py::module_& module) {
  add_distortion_map(module);
  py::class_<rectification::Rectification>(
      module, "Rectification", "The distortion map and its residuals, from one image of the plate.")
      .def_readonly("map", &rectification::Rectification::map, "DistortionMap")
      .def_property_readonly("uv_raw", &dots, "(N, 2) plate dots used, raw pixels.")
      .def_property_readonly(
          "residual_px",
          [](const rectification::Rectification& r) {
            return read_only(py::array_t<double>(py::ssize_t(r.residual_px.size()), r.residual_px.data()));
          },
          "(N,) residual of each plate dot to the fitted map, raw pixels.")
      .def_readonly("dots_found", &rectification::Rectification::dots_found)
      .def_readonly("dots_expected", &rectification::Rectification::dots_expected,
                    "None for an unbounded lattice.")
      .def_readonly("raw_mean_px", &rectification::Rectification::raw_mean_px,
                    "Mean distance from raw to rectified: the distortion.")
      .def_readonly("raw_max_px", &rectification::Rectification::raw_max_px)
      .def_property_readonly("warnings",
                             [](const rectification::Rectification& r) { return warning_list(r.warnings); })
      .def("__repr__", [](const rectification::Rectification& r) {
        const std::string expected = r.dots_expected ? fmt::format(" of {}", *r.dots_expected) : "";
        std::string text = fmt::format("<Rectification: {}{} dots, {:.3f} px rms", r.dots_found, expected,
                                       r.map.residual_rms_px);
        for (const Warning& warning : r.warnings) text += fmt::format(", warning {}", code(warning.reason));
        return text + ">";
      });
  module.def("rectify", &rectified, py::arg("image"), py::arg("plate"), py::kw_only(),
             py::arg("method") = std::string(word(pipeline::RunOptions{}.method)),
             py::arg("model") = py::none(),
             R"(Finds the plate in an image and fits the distortion map (2.1, Eq. 1-3).

plate: a Plate, a built-in's name ("plate48") or the path of a plate.json. method: "best" or "paper". model, of
method best: "polynomial", "radial" or "kriging"; None: by the number of dots and their held-out errors. Releases the GIL.
Returns a Rectification. Raises InputError; RefusedError: blank_image, saturated, plate_not_found, plate_mismatch.)");
}

}  // namespace helicarm::python
