// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "helicarm/core/failure.h"
#include "helicarm/image/image.h"
#include "helicarm/xray/patient_study.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::xray {

/// Three decades, where the range of a logarithmic image is not known.
inline constexpr double nominal_log_range = 6.908;

/// Pixel Spacing at the depth of an object, from a calibration.
struct ObjectSpacing {
  double source_object_mm;                   ///< along the central ray
  std::optional<double> source_detector_mm;  ///< nothing: the detector's pixel size is not known
  Eigen::Vector2d pixel_mm;                  ///< in the object's plane; x: column spacing, y: row spacing
  double relative_sigma = 0;                 ///< of pixel_mm
  std::string object = {};                   ///< its name
};

/// An image to be written as DICOM: XA, or RF, CR or DX by `acquisition.modality`. Contains no patient data
/// except the fields below.
struct DerivedImage {
  image::Image<std::uint16_t> pixels;
  int bits_stored = 16;     ///< 8 .. 16; up to 8 bits are written as one byte per pixel
  Acquisition acquisition;  ///< spacing, source distance, angles, flip, logarithmic; keys are not written,
                            ///< the time only of an image that is not derived or has its `patient_study`
  bool derived = true;      ///< DERIVED, patient identity removed; else ORIGINAL
  std::string series_description = {};
  std::string derivation = {};  ///< what was done to the source, one sentence
  std::string patient_name = "ANON";
  std::string patient_id = "ANON";
  std::string study_uid = {};  ///< each UID: empty for a new random one (see make_uid)
  std::string series_uid = {};
  std::string instance_uid = {};
  std::string source_instance_uid = {};  ///< of the image this one was made of; empty: none is named
  /// Of the source: written in place of the patient's name and ID, the study's UID and the source's UID.
  std::optional<PatientStudy> patient_study = {};
  /// Of a logarithmic image: natural logarithm of the ratio of dose between the highest and the lowest value.
  double log_range = nominal_log_range;
  /// Written in place of the source's distances: their modules' attributes, Pixel Spacing and the
  /// magnification.
  std::optional<ObjectSpacing> at_object = {};
  bool rle = false;  ///< RLE lossless instead of uncompressed
};

/// Writes an X-ray image, MONOCHROME2, atomically. A DX image without pixel size becomes XA. Refuses:
/// bad_size (empty, or a side over 16384), bad_value (a pixel over 2^bits_stored - 1), cannot_write.
Expected<void> write_dicom(const std::filesystem::path& path, const DerivedImage& image);

}  // namespace helicarm::xray
