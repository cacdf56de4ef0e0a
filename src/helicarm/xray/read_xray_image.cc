// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/read_xray_image.h"

#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/image/bmp.h"
#include "helicarm/image/png.h"
#include "helicarm/image/tiff.h"
#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/film.h"
#include "helicarm/xray/foreign_file.h"
#include "helicarm/xray/image_file.h"
#include "helicarm/xray/image_in_memory.h"
#include "helicarm/xray/jpeg.h"
#include "helicarm/xray/nrrd_sequence.h"
#include "helicarm/xray/read_dicom.h"

namespace helicarm::xray {
namespace fs = std::filesystem;

enum class FileKind { dicom, png, tiff, jpeg, bmp, film, nrrd };

namespace {

constexpr double square_tolerance = 0.01;
constexpr std::uintmax_t run_factor = 16;  // 4 GiB: a thousand frames of 1440 x 1440

/// Of a file that states no pixel size of its own.
std::string why_no_spacing(const fs::path& path) {
  const std::string origin = path.filename().string();
  if (const auto sidecar = sidecar_of(path))
    return fmt::format("{}: \"pixel_mm\" is not given", sidecar->filename().string());
  const auto other = other_json_of(path);
  return fmt::format(
      "{}: no sidecar {}.json with \"pixel_mm\" and \"source_detector_mm\"{}", origin, path.stem().string(),
      other ? fmt::format("; {} beside it is another kind of file", other->filename().string()) : "");
}

/// `highest`: value of its scale; nothing: by the bits that its pixels use.
XrayImage xray_image_of(const image::GreyImage& grey_image, const fs::path& path,
                        std::optional<float> highest = {}) {
  XrayImage xray_image;
  xray_image.pixels = image::Image<float>(grey_image.pixels.width(), grey_image.pixels.height());
  std::ranges::copy(grey_image.pixels.pixels(), xray_image.pixels.pixels().begin());
  xray_image.highest = highest ? *highest : grey_image.bits == 8 ? 255 : highest_grey(xray_image.pixels);
  if (grey_image.white_is_zero) invert(xray_image);
  const std::string origin = path.filename().string();
  xray_image.warnings.push_back({Reason::spacing_missing, why_no_spacing(path)});
  if (std::abs(grey_image.pixel_aspect - 1) > square_tolerance)
    xray_image.warnings.push_back(
        {Reason::tag_disagrees,
         fmt::format("{}: by its resolutions a pixel is {:.4g} times as high as wide; it is taken as square: "
                     "resample the image if that is right",
                     origin, grey_image.pixel_aspect),
         {},
         {{"aspect", grey_image.pixel_aspect}}});
  make_metal_dark(xray_image, origin);
  xray_image.acquisition.instance_key = image_key(xray_image.pixels);
  return xray_image;
}

FileKind file_kind(std::string_view bytes, const std::string& origin) {
  const bool has_preamble = bytes.size() >= 132 && bytes.compare(128, 4, "DICM") == 0;
  if (has_preamble) return FileKind::dicom;
  if (image::is_png(bytes)) return FileKind::png;
  if (image::is_tiff(bytes)) return FileKind::tiff;
  if (is_jpeg_file(bytes)) return FileKind::jpeg;
  if (image::is_bmp(bytes)) return FileKind::bmp;
  if (is_nrrd_sequence(bytes)) return FileKind::nrrd;
  if (looks_like_dicom(bytes)) return FileKind::dicom;
  const auto foreign = foreign_file(bytes);
  throw BadInput(Reason::not_an_image,
                 foreign ? fmt::format("{}: {}", origin, *foreign)
                         : fmt::format("{}: {}, not DICOM, PNG, TIFF, JPEG, BMP or a film", origin,
                                       bytes.empty() ? "zero bytes" : fmt::format("{} bytes", bytes.size())));
}

int frames_of(std::string_view bytes, FileKind kind, const std::string& origin) {
  if (kind == FileKind::dicom) return value_or_throw(check_dicom(bytes, origin)).frames;
  if (kind == FileKind::tiff) return value_or_throw(image::count_tiff_pages(bytes, origin));
  if (kind == FileKind::nrrd) return images_of_sequence(bytes, origin);
  return 1;
}

image::GreyImage grey_image_of(std::string_view bytes, FileKind kind, int page, const std::string& origin) {
  switch (kind) {
    case FileKind::png:
      return value_or_throw(image::decode_png(bytes, origin));
    case FileKind::tiff:
      return value_or_throw(image::decode_tiff(bytes, page, origin));
    case FileKind::nrrd:
      return image_of_sequence(bytes, page, origin);
    case FileKind::jpeg:
      return value_or_throw(decode_jpeg_file(bytes, origin));
    default:
      return value_or_throw(image::decode_bmp(bytes, origin));
  }
}

XrayImage image_of_film(const Film& film, const fs::path& path, std::optional<int> frame) {
  const std::string origin = path.filename().string();
  const int index = value_or_throw(choose_frame(origin, film.frames(), frame));
  XrayImage xray_image = xray_image_of(film.read(index), path, float((1 << film.bits()) - 1));
  if (const auto loss = film.loss())
    xray_image.warnings.push_back({Reason::lossy_image, fmt::format("{}: {}", origin, *loss)});
  return xray_image;
}

/// `outline` of a DICOM file; `bytes` of no film.
XrayImage read_by_content(const fs::path& path, std::string_view bytes, FileKind kind,
                          const DicomOutline* outline, const Film* film, std::optional<int> frame) {
  const std::string origin = path.filename().string();
  XrayImage xray_image;
  if (outline) {
    xray_image = value_or_throw(read_dicom_frame(*outline, frame));
  } else if (film) {
    xray_image = image_of_film(*film, path, frame);
  } else {
    const int page = value_or_throw(choose_frame(origin, frames_of(bytes, kind, origin), frame));
    xray_image = xray_image_of(grey_image_of(bytes, kind, page, origin), path);
    if (kind == FileKind::jpeg)
      xray_image.warnings.push_back(
          {Reason::lossy_image, fmt::format("{}: JPEG compresses an image with loss", origin)});
  }
  // NAME.json beside a DICOM file may be of its case.
  if (const auto sidecar = value_or_throw(stated_beside(path, kind == FileKind::dicom))) {
    const auto& [stated, name] = *sidecar;
    const int frames = outline ? outline->frames : film ? film->frames() : frames_of(bytes, kind, origin);
    if (frames > 1 && (stated.primary_deg || stated.secondary_deg))
      throw BadInput(
          {Reason::bad_value,
           fmt::format("{}: states one angle for the {} images of {}: leave it out, or save the images "
                       "as numbered files with a sidecar each",
                       name, frames, origin),
           {},
           {{"frames", double(frames)}}});
    value_or_throw(state_geometry(xray_image, stated, name));
  }
  return xray_image;
}

XrayImage read_by_content(const fs::path& path, std::optional<int> frame) {
  if (const auto film = Film::at(path))
    return read_by_content(path, {}, FileKind::film, nullptr, film.get(), frame);
  std::string bytes = value_or_throw(read_file(path, max_image_file_bytes));
  const std::string origin = path.filename().string();
  const FileKind kind = file_kind(bytes, origin);
  if (kind == FileKind::nrrd) bytes = unpacked_sequence(std::move(bytes), origin);
  if (kind != FileKind::dicom) return read_by_content(path, bytes, kind, nullptr, nullptr, frame);
  const DicomOutline outline = value_or_throw(check_dicom(bytes, origin));
  return read_by_content(path, bytes, kind, &outline, nullptr, frame);
}

/// With the view's name, or the failure of that view.
Expected<XrayImage> named(Expected<XrayImage> xray_image, const std::string& view_name) {
  if (!xray_image) {
    Failure failure = std::move(xray_image).error();
    failure.view = view_name;
    return tl::unexpected<Failure>(std::move(failure));
  }
  xray_image->name = view_name;
  for (Warning& warning : xray_image->warnings) warning.view = view_name;
  return xray_image;
}

}  // namespace

struct ImageFile::Content {
  fs::path path;
  std::string bytes;
  FileKind kind = FileKind::dicom;
  std::optional<DicomOutline> outline = {};
  std::shared_ptr<const Film> film = {};
  int frames = 1;
  std::vector<XrayImage> images = {};  ///< in memory: then there is no file
};

ImageFile::ImageFile(std::unique_ptr<Content> content) : content_(std::move(content)) {}
ImageFile::~ImageFile() = default;

Expected<std::shared_ptr<const ImageFile>> ImageFile::open(const fs::path& path) {
  return guarded([&] {
    if (auto film = Film::at(path)) {
      auto content = std::make_unique<Content>(Content{path, {}, FileKind::film});
      content->frames = film->frames();
      content->film = std::move(film);
      return std::shared_ptr<const ImageFile>(new ImageFile(std::move(content)));
    }
    auto content = std::make_unique<Content>(
        Content{path, value_or_throw(read_file(path, max_image_file_bytes * run_factor))});
    const std::string origin = path.filename().string();
    content->kind = file_kind(content->bytes, origin);
    if (content->kind == FileKind::nrrd)
      content->bytes = unpacked_sequence(std::move(content->bytes), origin);
    if (content->kind == FileKind::dicom) {
      content->outline = value_or_throw(check_dicom(content->bytes, origin));
      content->frames = content->outline->frames;
    } else {
      content->frames = frames_of(content->bytes, content->kind, origin);
    }
    return std::shared_ptr<const ImageFile>(new ImageFile(std::move(content)));
  });
}

Expected<std::shared_ptr<const ImageFile>> ImageFile::of(std::vector<XrayImage> images) {
  if (images.empty()) return fail(Reason::bad_size, "images: is empty, at least one is required");
  auto content = std::make_unique<Content>();
  content->frames = int(images.size());
  content->images = std::move(images);
  return std::shared_ptr<const ImageFile>(new ImageFile(std::move(content)));
}

int ImageFile::frames() const { return content_->frames; }

Expected<void> ImageFile::check_angles() const {
  if (!content_->outline) return {};
  const DicomElements& elements = content_->outline->elements;
  for (const DicomTag tag : {tags::primary_increment, tags::secondary_increment}) {
    const std::size_t count = elements.count(tag);
    if (count > 1 && count != std::size_t(frames()))
      return fail(
          Reason::bad_value,
          fmt::format("{}: {} ({:04X},{:04X}) has {} values for {} frames: one value or one a frame "
                      "is required",
                      elements.origin, tag.name, tag.number >> 16, tag.number & 0xFFFF, count, frames()),
          {{"values", double(count)}, {"frames", double(frames())}});
  }
  return {};
}

Expected<XrayImage> ImageFile::read(const std::string& view_name, std::optional<int> frame) const {
  const Content& of = *content_;
  if (!of.images.empty())
    return named(choose_frame("images", of.frames, frame).map([&](int index) {
      return of.images[std::size_t(index)];
    }),
                 view_name);
  return named(guarded([&] {
                 return read_by_content(of.path, of.bytes, of.kind, of.outline ? &*of.outline : nullptr,
                                        of.film.get(), frame);
               }),
               view_name);
}

Expected<int> count_frames(const fs::path& path) {
  return guarded([&] {
    if (const auto film = Film::at(path)) return film->frames();
    const std::string bytes = value_or_throw(read_file(path, max_image_file_bytes));
    const std::string origin = path.filename().string();
    return frames_of(bytes, file_kind(bytes, origin), origin);
  });
}

Expected<XrayImage> image_of_dicom(const std::string& bytes, const std::string& view_name,
                                   std::optional<int> frame) {
  return named(check_dicom(bytes, view_name).and_then([&](const DicomOutline& outline) {
    return read_dicom_frame(outline, frame);
  }),
               view_name);
}

Expected<XrayImage> read_xray_image(const fs::path& path, const std::string& view_name,
                                    std::optional<int> frame) {
  return named(guarded([&] { return read_by_content(path, frame); }), view_name);
}

Expected<XrayImage> read_xray_image(const fs::path& path, std::optional<int> frame) {
  Expected<XrayImage> read = read_xray_image(path, path.filename().string(), frame);
  if (!read) read.error().view.clear();
  return read;
}

}  // namespace helicarm::xray
