// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "helicarm/core/files.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/read_dicom.h"
#include "helicarm/xray/write_dicom.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

/// Written as an image of 16 bits, the values read back equal.
void check_written_again(const xray::XrayImage& xray_image) {
  xray::DerivedImage image;
  image.pixels = image::Image<std::uint16_t>(xray_image.pixels.width(), xray_image.pixels.height());
  for (int v = 0; v < xray_image.pixels.height(); ++v)
    for (int u = 0; u < xray_image.pixels.width(); ++u)
      image.pixels(u, v) = static_cast<std::uint16_t>(xray_image.pixels(u, v) - xray_image.lowest);
  image.acquisition = xray_image.acquisition;
  image.rle = xray_image.pixels.width() % 2 == 0;
  const auto path = folder() / "written.dcm";
  check(xray::write_dicom(path, image).has_value(), "an image that was read can be written");
  const auto again = xray::read_dicom(read_file(path, 1 << 30).value(), "written.dcm", {});
  check(again.has_value(), "an image that was written can be read");
  check(again->acquisition.pixel_mm.has_value() == xray_image.acquisition.pixel_mm.has_value(),
        "the spacing is kept");
  check(again->acquisition.source_detector_mm.has_value() ==
            xray_image.acquisition.source_detector_mm.has_value(),
        "the source distance is kept");
}

}  // namespace

void run(std::string_view bytes) {
  const auto xray_image = xray::read_dicom(bytes, "input.dcm", 1);
  if (!xray_image) return;
  const auto pixels = xray_image->pixels.pixels();
  check(!pixels.empty(), "an image has pixels");
  for (const float pixel : pixels)
    check(pixel >= xray_image->lowest && pixel <= xray_image->highest,
          "pixels are between lowest and highest");
  const xray::Acquisition& acquisition = xray_image->acquisition;
  if (acquisition.pixel_mm)
    check(acquisition.pixel_mm->minCoeff() >= 0.01 && acquisition.pixel_mm->maxCoeff() <= 2,
          "the spacing is in range");
  if (acquisition.acquired)
    check(std::isfinite(acquisition.acquired->seconds) && acquisition.acquired->resolution_s > 0,
          "the time is valid");
  check(acquisition.uid_key.size() == 32 && acquisition.instance_key.size() == 32, "an image has its keys");
  constexpr std::size_t small = 4096;
  if (pixels.size() <= small) check_written_again(*xray_image);
}

std::vector<std::string> seeds() {
  xray::DicomBuilder dated, implicit, bytes, cine;
  dated.text(0x0008002A, "DT", "20240229235960.123456+0100").text(0x00080201, "SH", "+0100");
  dated.text(0x00181510, "DS", "12.5").text(0x00181511, "DS", "-3").text(0x00280030, "DS", "0.3\\0.2");
  dated.text(0x00187034, "CS", "YES").text(0x00187032, "DS", "90").word(0x00281041, -1, "SS");
  dated.text(0x00082218, "SQ", "").text(0x00282110, "CS", "01").text(0x20500020, "CS", "IDENTITY");
  implicit.syntax("1.2.840.10008.1.2").text(0x00280004, "CS", "MONOCHROME1");
  bytes.word(0x00280100, 8)
      .word(0x00280101, 8)
      .word(0x00280102, 7)
      .raw(0x7FE00010, "OB", std::string(48, 'x'));
  std::vector<std::uint16_t> values(144, 7);
  cine.text(0x00280008, "IS", "3").pixels(values).word(0x00280103, 1);
  std::vector<std::string> all{xray::DicomBuilder().bytes(), dated.bytes(), implicit.bytes(), bytes.bytes(),
                               cine.bytes()};
  for (const bool rle : {false, true}) {
    xray::DerivedImage image;
    image.pixels = image::Image<std::uint16_t>(20, 10, 300);
    for (int i = 0; i < 10; ++i) image.pixels(i, i) = static_cast<std::uint16_t>(7 * i);
    image.acquisition.pixel_mm = {0.2, 0.3};
    image.acquisition.source_detector_mm = 1000;
    image.rle = rle;
    if (xray::write_dicom(folder() / "seed.dcm", image))
      all.push_back(read_file(folder() / "seed.dcm", 1 << 20).value());
  }
  return all;
}

}  // namespace helicarm::fuzz
