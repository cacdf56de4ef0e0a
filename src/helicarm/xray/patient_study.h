// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include "helicarm/core/failure.h"

namespace helicarm::xray {

struct DicomElements;

/// The patient and study of a DICOM file, for images that shall be stored with it. Never printed or logged.
struct PatientStudy {
  std::map<std::uint32_t, std::string> elements;  ///< Patient and General Study modules, by number
  std::string sop_class_uid, sop_instance_uid;    ///< of the file
};

/// Fails as `read_dicom`; refuses not_an_image for files that are not DICOM.
Expected<PatientStudy> read_patient_study(const std::filesystem::path& file);

PatientStudy patient_study_in(const DicomElements& elements);

}  // namespace helicarm::xray
