// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "helicarm/core/failure.h"
#include "helicarm/xray/patient_study.h"

namespace helicarm::xray {

/// The frame of reference of a CT series, with patient and study of one of its slices.
struct CtFrame {
  std::string frame_of_reference_uid;
  PatientStudy patient_study;
};

/// Of the file of a CT slice; nothing for another file, or where the slice states none.
Expected<std::optional<CtFrame>> ct_frame_of(const std::filesystem::path& slice);

/// A rigid registration of a CT to another frame.
struct SpatialRegistration {
  CtFrame ct;
  std::string frame_of_reference_uid;    ///< of the other frame
  std::array<double, 16> frame_from_ct;  ///< 4 x 4 by rows, mm; CT: L, P, S
  std::string description;               ///< its first 64 bytes are written, without a backslash
};

/// Writes a Spatial Registration Storage object (PS3.3 A.39), atomically and readable by its owner alone: it
/// holds the CT's patient and study. UIDs follow from the content. Refuses: bad_value (the matrix is not
/// rigid), cannot_write.
Expected<void> write_spatial_registration(const std::filesystem::path& path,
                                          const SpatialRegistration& registration);

}  // namespace helicarm::xray
