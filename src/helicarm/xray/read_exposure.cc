// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/read_exposure.h"

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/image/png.h"
#include "helicarm/image/tiff.h"
#include "helicarm/xray/dicom_acquisition.h"
#include "helicarm/xray/read_dicom.h"

namespace helicarm {
namespace fs = std::filesystem;

namespace {

constexpr std::uintmax_t max_file_bytes = 256u << 20;

fs::path sidecar_of(const fs::path& picture) {
  fs::path full = picture;
  full += ".json";
  if (fs::exists(full)) return full;
  fs::path plain = picture;
  plain.replace_extension(".json");
  if (!fs::exists(plain))
    throw BadInput(
        Reason::missing_file,
        fmt::format("{}: no such file: the sidecar of {}, holding \"pixel_mm\" and \"source_detector_mm\"",
                    plain.string(), picture.filename().string()));
  return plain;
}

Acquisition read_sidecar(const fs::path& path) {
  const Json json = value_or_throw(read_json(path));
  JsonReader reader(json, path.filename().string());
  Acquisition acquisition;
  if (const auto pixel_mm = reader.optional_number("pixel_mm", {min_pixel_mm, max_pixel_mm}))
    acquisition.pixel_mm = Eigen::Vector2d::Constant(*pixel_mm);
  acquisition.source_detector_mm =
      reader.optional_number("source_detector_mm", {min_source_detector_mm, max_source_detector_mm});
  reader.finish();
  return acquisition;
}

Exposure picture_exposure(const GreyPicture& picture, const fs::path& path) {
  Exposure exposure;
  exposure.acquisition = read_sidecar(sidecar_of(path));
  exposure.highest = picture.bits == 8 ? 255 : 65535;
  exposure.pixels = Image<float>(picture.pixels.width(), picture.pixels.height());
  std::ranges::copy(picture.pixels.pixels(), exposure.pixels.pixels().begin());
  const std::string origin = path.filename().string();
  if (!exposure.acquisition.pixel_mm)
    exposure.warnings.push_back(
        {Reason::spacing_missing, fmt::format("{}: its sidecar gives no \"pixel_mm\"", origin)});
  make_metal_dark(exposure, origin);
  exposure.acquisition.instance_key = picture_key(exposure.pixels);
  return exposure;
}

Exposure read_by_content(const fs::path& path, std::optional<int> frame) {
  const std::string bytes = value_or_throw(read_file(path, max_file_bytes));
  const std::string origin = path.filename().string();
  if (bytes.size() >= 132 && bytes.compare(128, 4, "DICM") == 0)
    return value_or_throw(read_dicom(bytes, origin, frame));
  if (is_png(bytes)) {
    value_or_throw(choose_frame(origin, 1, frame));
    return picture_exposure(value_or_throw(decode_png(bytes, origin)), path);
  }
  if (is_tiff(bytes)) {
    const int pages = value_or_throw(count_tiff_pages(bytes, origin));
    const int page = value_or_throw(choose_frame(origin, pages, frame));
    return picture_exposure(value_or_throw(decode_tiff(bytes, page, origin)), path);
  }
  throw BadInput(Reason::not_an_image,
                 fmt::format("{}: {}, neither DICOM with a preamble nor PNG nor TIFF", origin,
                             bytes.empty() ? "zero bytes" : fmt::format("{} bytes", bytes.size())));
}

}  // namespace

Expected<Exposure> read_exposure(const fs::path& path, const std::string& view_name,
                                 std::optional<int> frame) {
  auto exposure = guarded([&] { return read_by_content(path, frame); });
  if (!exposure) {
    Failure failure = std::move(exposure).error();
    failure.view = view_name;
    return tl::unexpected<Failure>(std::move(failure));
  }
  exposure->name = view_name;
  for (Warning& warning : exposure->warnings) warning.view = view_name;
  return exposure;
}

}  // namespace helicarm
