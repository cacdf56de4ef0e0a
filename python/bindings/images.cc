// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <memory>

#include "arrays.h"
#include "checks.h"
#include "helicarm/detection/find_marks.h"
#include "helicarm/image/grey_image.h"
#include "helicarm/xray/dicom_acquisition.h"
#include "helicarm/xray/image_in_memory.h"
#include "helicarm/xray/read_dicom.h"
#include "helicarm/xray/read_xray_image.h"
#include "module.h"

namespace helicarm::python {
namespace {

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;

/// What the array's type can hold; of floating-point pixels the caller must say it. Of 16 bits a detector
/// uses fewer, as the pixels show (`highest_grey`), like those of a file.
std::pair<float, float> range_of(const py::array& pixels,
                                 const std::optional<std::pair<float, float>>& stated) {
  if (stated) {
    checked(stated->first, any_number, "range: least");
    checked(stated->second, {stated->first, std::numeric_limits<float>::max(), true}, "range: greatest");
    return *stated;
  }
  const char kind = pixels.dtype().kind();
  if (kind == 'u' && pixels.itemsize() <= 2) return {0.f, pixels.itemsize() == 1 ? 255.f : 65535.f};
  raise({Reason::bad_value,
         "range: (least, greatest) grey value, is required for pixels that are neither uint8 nor uint16",
         {},
         {}});
}

std::optional<Eigen::Vector2d> spacing_of(const py::object& pixel_mm) {
  if (pixel_mm.is_none()) return {};
  const Doubles spacings = Doubles::ensure(pixel_mm);
  if (!spacings || (spacings.size() != 1 && spacings.size() != 2))
    raise({Reason::bad_value, "pixel_mm: is neither a number nor (column spacing, row spacing)", {}, {}});
  Eigen::Vector2d spacing(spacings.data()[0], spacings.data()[spacings.size() - 1]);
  for (const double mm : spacing) checked(mm, {xray::min_pixel_mm, xray::max_pixel_mm}, "pixel_mm");
  return spacing;
}

xray::XrayImage image_from(const py::object& given, const py::object& pixel_mm,
                           std::optional<double> source_detector_mm,
                           const std::optional<std::pair<float, float>>& range, const std::string& name) {
  const py::array pixels = plain_array(given, "pixels");
  if (pixels.ndim() != 2 || pixels.size() == 0 || pixels.shape(0) > image::max_image_side ||
      pixels.shape(1) > image::max_image_side)
    raise({Reason::bad_size,
           fmt::format("pixels: shape {} is not (height, width) with sides from 1 to {}", shape_of(pixels),
                       image::max_image_side),
           {},
           {}});
  xray::XrayImage image;
  std::tie(image.lowest, image.highest) = range_of(pixels, range);
  const Floats values = Floats::ensure(pixels);
  if (!values) raise({Reason::bad_value, "pixels: are not numbers", {}, {}});
  image.name = name;
  image.pixels = image::Image<float>(int(values.shape(1)), int(values.shape(0)));
  for (std::size_t i = 0; i < image.pixels.pixels().size(); ++i) {
    checked(values.data()[i], {image.lowest, image.highest}, "pixels");
    image.pixels.pixels()[i] = values.data()[i];
  }
  if (!range && pixels.itemsize() == 2) image.highest = xray::highest_grey(image.pixels);
  image.acquisition.pixel_mm = spacing_of(pixel_mm);
  image.acquisition.source_detector_mm = checked(
      source_detector_mm, {xray::min_source_detector_mm, xray::max_source_detector_mm}, "source_detector_mm");
  return image;
}

py::tuple state_of(const xray::XrayImage& image) {
  const xray::Acquisition& a = image.acquisition;
  const py::object acquired =
      a.acquired
          ? py::object(py::make_tuple(a.acquired->seconds, a.acquired->resolution_s, a.acquired->source))
          : py::object(py::none());
  return py::make_tuple(
      py::array_t<float>({py::ssize_t(image.pixels.height()), py::ssize_t(image.pixels.width())},
                         image.pixels.pixels().data()),
      image.name, image.lowest, image.highest, warning_list(image.warnings), vector_array<2>(a.pixel_mm),
      a.source_detector_mm, a.source_patient_mm, a.primary_angle_deg, a.secondary_angle_deg, acquired,
      a.flip_hint, a.rotation_hint_deg, a.logarithmic, a.modality, a.technique, a.patient_key, a.study_key,
      a.frame_of_reference_key, a.instance_key, a.uid_key);
}

std::shared_ptr<xray::XrayImage> image_of_state(const py::tuple& state) {
  auto loaded = std::make_shared<xray::XrayImage>();
  std::size_t next = 0;
  const auto take = [&](auto& value) { value = state[next++].cast<std::decay_t<decltype(value)>>(); };
  Floats pixels;
  py::list warnings;
  py::object pixel_mm, acquired;
  xray::Acquisition& a = loaded->acquisition;
  take(pixels), take(loaded->name), take(loaded->lowest), take(loaded->highest), take(warnings),
      take(pixel_mm);
  take(a.source_detector_mm), take(a.source_patient_mm), take(a.primary_angle_deg);
  take(a.secondary_angle_deg), take(acquired), take(a.flip_hint), take(a.rotation_hint_deg);
  take(a.logarithmic), take(a.modality), take(a.technique), take(a.patient_key), take(a.study_key);
  take(a.frame_of_reference_key), take(a.instance_key), take(a.uid_key);
  loaded->pixels = image::Image<float>(int(pixels.shape(1)), int(pixels.shape(0)));
  std::copy_n(pixels.data(), pixels.size(), loaded->pixels.pixels().begin());
  loaded->warnings = warnings_from(warnings);
  a.pixel_mm = spacing_of(pixel_mm);
  if (!acquired.is_none()) {
    const auto [seconds, resolution_s, source] = acquired.cast<std::tuple<double, double, std::string>>();
    a.acquired = {seconds, resolution_s, source};
  }
  return loaded;
}

py::dict marks(const xray::XrayImage& image, const std::string& kind) {
  const detection::MarkKind which = value_or_raise(detection::mark_kind(kind));
  const std::vector<detection::Dot> dots = without_gil([&] { return detection::find_marks(image, which); });
  std::vector<Eigen::Vector2d> uv;
  py::array_t<double> sigma(py::ssize_t(dots.size())), radius(py::ssize_t(dots.size()));
  for (std::size_t i = 0; i < dots.size(); ++i) {
    uv.push_back(dots[i].centre_px);
    sigma.mutable_at(i) = dots[i].sigma_px;
    radius.mutable_at(i) = dots[i].radius_px;
  }
  py::dict found;
  found["uv"] = rows_array<2>(uv);
  found["sigma_px"] = sigma;
  found["radius_px"] = radius;
  return found;
}

std::shared_ptr<xray::XrayImage> image_at(const std::filesystem::path& path, std::optional<int> frame,
                                          const std::optional<std::string>& name) {
  auto image =
      without_gil([&] { return xray::read_xray_image(path, name.value_or(path.stem().string()), frame); });
  return std::make_shared<xray::XrayImage>(value_or_raise(std::move(image)));
}

}  // namespace

void add_images(py::module_& module) {
  py::class_<xray::XrayImage, std::shared_ptr<xray::XrayImage>>(module, "XrayImage",
                                                                R"(An X-ray image as stored.

Pixels are neither flipped nor turned. Pixel (0, 0) is the centre of the top-left pixel; u (column) runs right,
v (row) down. Points are always (u, v); arrays are indexed [v, u].

XrayImage(pixels, *, pixel_mm, source_detector_mm, range=None, name="")
  pixels: (height, width), real numbers without a mask; converted to float32 by one copy
  pixel_mm: detector pixel spacing, 0.01 to 2 mm: a number, (column, row), or None where unknown
  source_detector_mm: 200 to 3000 mm, or None where unknown
  range: least and greatest possible grey value, which no pixel exceeds; of uint8 pixels 0 to 255, of uint16 that of
    the bits that the pixels use, as of a file's
Raises InputError: bad_size, bad_value, not_finite.)")
      .def(py::init(&image_from), py::arg("pixels"), py::kw_only(), py::arg("pixel_mm"),
           py::arg("source_detector_mm"), py::arg("range") = py::none(), py::arg("name") = "")
      .def_property_readonly(
          "pixels",
          [](const py::object& self) { return view_of(self.cast<const xray::XrayImage&>().pixels, self); },
          "(height, width) float32, read only, not copied: it shares the image's memory.")
      .def_readonly("name", &xray::XrayImage::name)
      .def_property_readonly(
          "shape", [](const xray::XrayImage& i) { return std::pair(i.pixels.height(), i.pixels.width()); },
          "(height, width)")
      .def_property_readonly(
          "range", [](const xray::XrayImage& i) { return std::pair(i.lowest, i.highest); },
          "Least and greatest grey value that the file could have stored.")
      .def_property_readonly(
          "pixel_mm", [](const xray::XrayImage& i) { return vector_array<2>(i.acquisition.pixel_mm); },
          "(column, row) spacing on the detector, mm; None where the file does not state it.")
      .def_property_readonly(
          "source_detector_mm", [](const xray::XrayImage& i) { return i.acquisition.source_detector_mm; },
          "mm, or None.")
      .def_property_readonly("warnings", [](const xray::XrayImage& i) { return warning_list(i.warnings); })
      .def(py::pickle(&state_of, &image_of_state))
      .def("__repr__", [](const xray::XrayImage& i) {
        return fmt::format("<XrayImage {}: {} x {} pixels>", i.name, i.pixels.width(), i.pixels.height());
      });
  module.def(
      "read_image", &image_at, py::arg("path"), py::kw_only(), py::arg("frame") = py::none(),
      py::arg("name") = py::none(),
      R"(Reads a DICOM, PNG, TIFF, JPEG or BMP X-ray image, or a frame of a film by ffmpeg; the content decides which.

pixel_mm and source_detector_mm may stand in a sidecar NAME.json, of DICOM NAME.dcm.json. frame: 1-based, needed only where the
file holds several. name: of the view; the file's stem where not given. Releases the GIL.
Raises InputError: missing_file, not_an_image, truncated, bad_size, bad_value, unsupported, bad_json.)");
  module.def("_image_of_dicom",
             [](const std::string& bytes, const std::string& name, std::optional<int> frame) {
               auto image = without_gil([&] { return xray::image_of_dicom(bytes, name, frame); });
               return std::make_shared<xray::XrayImage>(value_or_raise(std::move(image)));
             });
  module.def("detect", &marks, py::arg("image"), py::kw_only(), py::arg("kind"),
             R"(Balls, holes or crosses (kind) anywhere in an image, without plate or calibrator.

Returns {"uv": (N, 2) raw pixels, "sigma_px": (N,) standard deviation per axis by image noise alone, "radius_px": (N,)};
of crosses the radius is half the wires' width. A ball's "uv" is the centre of its shadow; label gives the image of its
centre, with the error of the shadow's model. Releases the GIL. Raises InputError: usage for another kind.)");
}

}  // namespace helicarm::python
