// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/patient_study.h"

#include "helicarm/core/files.h"
#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm::xray {

PatientStudy patient_study_in(const DicomElements& elements) {
  PatientStudy read;
  for (const DicomTag tag : tags::patient_study)
    if (const std::string_view value = elements.text(tag); !value.empty())
      read.elements.emplace(tag.number, value);
  read.sop_class_uid = elements.text(tags::sop_class);
  read.sop_instance_uid = elements.text(tags::sop_instance);
  return read;
}

Expected<PatientStudy> read_patient_study(const std::filesystem::path& file) {
  return guarded([&] {
    const std::string bytes = value_or_throw(read_file(file, max_image_file_bytes));
    return patient_study_in(value_or_throw(check_dicom(bytes, file.filename().string())).elements);
  });
}

}  // namespace helicarm::xray
