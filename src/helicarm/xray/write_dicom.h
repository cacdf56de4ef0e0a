// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "helicarm/core/failure.h"
#include "helicarm/image/image.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::xray {

/// An image to be written as DICOM. Contains no patient data except the fields below.
struct DerivedImage {
  image::Image<std::uint16_t> pixels;
  int bits_stored = 16;  ///< 8 .. 16; up to 8 bits are written as one byte per pixel
  Acquisition
      acquisition;      ///< spacing, source distance, angles, time, flip, logarithmic; keys are not written
  bool derived = true;  ///< DERIVED, patient identity removed; else ORIGINAL
  std::string series_description = {};
  std::string patient_name = "ANON";
  std::string patient_id = "ANON";
  std::string study_uid = {};  ///< each UID: empty for a new random one (see make_uid)
  std::string series_uid = {};
  std::string instance_uid = {};
  bool rle = false;  ///< RLE lossless instead of uncompressed
};

/// Writes an X-ray angiographic image, MONOCHROME2, atomically. Refuses: bad_size (empty, or a side over
/// 16384), bad_value (a pixel over 2^bits_stored - 1), cannot_write.
Expected<void> write_dicom(const std::filesystem::path& path, const DerivedImage& image);

}  // namespace helicarm::xray
