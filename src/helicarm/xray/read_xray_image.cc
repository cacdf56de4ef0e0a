// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/read_xray_image.h"

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/geometry/import_matrix.h"
#include "helicarm/image/png.h"
#include "helicarm/image/tiff.h"
#include "helicarm/xray/dicom_acquisition.h"
#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/read_dicom.h"

namespace helicarm::xray {
namespace fs = std::filesystem;

namespace {

Acquisition read_sidecar(const fs::path& path) {
  const Json json = value_or_throw(read_json(path));
  if (geometry::holds_camera(json))
    throw BadInput(
        Reason::unsupported,
        fmt::format("{}: lies where an image's \"pixel_mm\" and \"source_detector_mm\" are expected, "
                    "and holds a camera: rename it, e.g. {}_camera.json",
                    path.filename().string(), path.stem().string()));
  JsonReader reader(json, path.filename().string());
  Acquisition acquisition;
  if (const auto pixel_mm = reader.optional_number("pixel_mm", {min_pixel_mm, max_pixel_mm}))
    acquisition.pixel_mm = Eigen::Vector2d::Constant(*pixel_mm);
  acquisition.source_detector_mm =
      reader.optional_number("source_detector_mm", {min_source_detector_mm, max_source_detector_mm});
  reader.finish();
  return acquisition;
}

XrayImage xray_image_of_png(const image::GreyImage& grey_image, const fs::path& path) {
  XrayImage xray_image;
  const auto sidecar = sidecar_of(path);
  if (sidecar) xray_image.acquisition = read_sidecar(*sidecar);
  xray_image.pixels = image::Image<float>(grey_image.pixels.width(), grey_image.pixels.height());
  std::ranges::copy(grey_image.pixels.pixels(), xray_image.pixels.pixels().begin());
  xray_image.highest = grey_image.bits == 8 ? 255 : highest_grey(xray_image.pixels);
  const std::string origin = path.filename().string();
  if (!xray_image.acquisition.pixel_mm)
    xray_image.warnings.push_back(
        {Reason::spacing_missing,
         sidecar ? fmt::format("{}: \"pixel_mm\" is not given", sidecar->filename().string())
                 : fmt::format("{}: no sidecar {}.json with \"pixel_mm\" and \"source_detector_mm\"", origin,
                               path.stem().string())});
  make_metal_dark(xray_image, origin);
  xray_image.acquisition.instance_key = image_key(xray_image.pixels);
  return xray_image;
}

bool is_dicom(std::string_view bytes) { return bytes.size() >= 132 && bytes.compare(128, 4, "DICM") == 0; }

BadInput not_an_image(std::string_view bytes, const std::string& origin) {
  return {Reason::not_an_image,
          fmt::format("{}: {}, neither DICOM with a preamble nor PNG nor TIFF", origin,
                      bytes.empty() ? "zero bytes" : fmt::format("{} bytes", bytes.size()))};
}

XrayImage read_by_content(const fs::path& path, std::optional<int> frame) {
  const std::string bytes = value_or_throw(read_file(path, max_image_file_bytes));
  const std::string origin = path.filename().string();
  if (is_dicom(bytes)) return value_or_throw(read_dicom(bytes, origin, frame));
  if (image::is_png(bytes)) {
    value_or_throw(choose_frame(origin, 1, frame));
    return xray_image_of_png(value_or_throw(image::decode_png(bytes, origin)), path);
  }
  if (image::is_tiff(bytes)) {
    const int pages = value_or_throw(image::count_tiff_pages(bytes, origin));
    const int page = value_or_throw(choose_frame(origin, pages, frame));
    return xray_image_of_png(value_or_throw(image::decode_tiff(bytes, page, origin)), path);
  }
  throw not_an_image(bytes, origin);
}

}  // namespace

std::optional<fs::path> sidecar_of(const fs::path& image) {
  fs::path full = image;
  full += ".json";
  fs::path plain = image;
  plain.replace_extension(".json");
  for (const fs::path& sidecar : {full, plain})
    if (fs::exists(sidecar)) return sidecar;
  return std::nullopt;
}

Expected<int> count_frames(const fs::path& path) {
  return guarded([&] {
    const std::string bytes = value_or_throw(read_file(path, max_image_file_bytes));
    const std::string origin = path.filename().string();
    if (is_dicom(bytes)) return value_or_throw(check_dicom(bytes, origin)).frames;
    if (image::is_png(bytes)) return 1;
    if (image::is_tiff(bytes)) return value_or_throw(image::count_tiff_pages(bytes, origin));
    throw not_an_image(bytes, origin);
  });
}

Expected<XrayImage> read_xray_image(const fs::path& path, const std::string& view_name,
                                    std::optional<int> frame) {
  auto xray_image = guarded([&] { return read_by_content(path, frame); });
  if (!xray_image) {
    Failure failure = std::move(xray_image).error();
    failure.view = view_name;
    return tl::unexpected<Failure>(std::move(failure));
  }
  xray_image->name = view_name;
  for (Warning& warning : xray_image->warnings) warning.view = view_name;
  return xray_image;
}

}  // namespace helicarm::xray
