// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/dataset_writing.h"

#include <algorithm>
#include <array>
#include <ctime>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/private_files.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/uid.h"

namespace helicarm::xray {
namespace {

constexpr const char* utf_8 = "ISO_IR 192";

/// Printable ASCII: the same in every character set of DICOM. An escape would change the set.
bool is_in_every_set(std::string_view text) {
  return std::ranges::all_of(
      text, [](unsigned char c) { return c == '\n' || c == '\r' || (c >= ' ' && c < 0x7F); });
}

bool holds_utf_8(const PatientStudy& patient_study) {
  const auto set = patient_study.elements.find(tags::patient_study.front().number);
  return set == patient_study.elements.end() || set->second == utf_8 ||
         std::ranges::all_of(patient_study.elements,
                             [](const auto& element) { return is_in_every_set(element.second); });
}

}  // namespace

void put_in(DcmItem& item, const DcmTagKey& tag, const std::string& value) {
  if (item.putAndInsertString(tag, value.c_str()).bad())
    throw BadInput(Reason::cannot_write, fmt::format("DICOM: {} cannot be stored", tag.toString().c_str()));
}

DcmItem& item_in(DcmItem& item, const DcmTagKey& sequence, long at) {
  DcmItem* made = nullptr;
  if (item.findOrCreateSequenceItem(sequence, made, at).bad())
    throw BadInput(Reason::cannot_write, "DICOM: a sequence cannot be stored");
  return *made;
}

std::string decimal_string(double value) { return fmt::format("{:.9g}", value); }

std::string own_text(const PatientStudy& patient_study, std::string text) {
  if (!holds_utf_8(patient_study))
    std::ranges::replace_if(
        text,
        [](char c) {
          return !is_in_every_set({&c, 1});
        },
        '?');
  return text;
}

namespace {

/// YYYYMMDDHHMMSS here, as the study's times are without Timezone Offset From UTC (0008,0201).
std::string local_date_time() {
  const std::time_t now = std::time(nullptr);
  std::tm here{};
  localtime_r(&now, &here);
  std::array<char, 16> text{};
  return {text.data(), std::strftime(text.data(), text.size(), "%Y%m%d%H%M%S", &here)};
}

}  // namespace

void put_object(DcmDataset& dataset, const char* sop_class, const std::string& modality,
                const std::string& content, const PatientStudy& patient_study) {
  const std::string key = text_key(content);
  const std::string now = local_date_time();
  put_in(dataset, DCM_SOPClassUID, sop_class);
  put_in(dataset, DCM_SOPInstanceUID, uid_of(key));
  put_in(dataset, DCM_SeriesInstanceUID, uid_of(text_key(key + " series")));
  put_in(dataset, DCM_Modality, modality);
  put_in(dataset, DCM_SeriesNumber, "1");
  put_in(dataset, DCM_InstanceNumber, "1");
  put_in(dataset, DCM_Manufacturer, "helicarm");
  put_in(dataset, DCM_SoftwareVersions, HELICARM_VERSION);
  put_in(dataset, DCM_ContentDate, now.substr(0, 8));
  put_in(dataset, DCM_ContentTime, now.substr(8, 6));
  for (const auto& [number, value] : patient_study.elements)
    put_in(dataset, {static_cast<Uint16>(number >> 16), static_cast<Uint16>(number & 0xFFFF)}, value);
  if (holds_utf_8(patient_study)) put_in(dataset, DCM_SpecificCharacterSet, utf_8);
  for (const DcmTagKey& tag :
       {DCM_PatientName, DCM_PatientID, DCM_PatientBirthDate, DCM_PatientSex, DCM_StudyDate, DCM_StudyTime,
        DCM_StudyID, DCM_AccessionNumber, DCM_ReferringPhysicianName})
    if (!dataset.tagExists(tag)) dataset.insertEmptyElement(tag);
  if (!dataset.tagExists(DCM_StudyInstanceUID))
    put_in(dataset, DCM_StudyInstanceUID, uid_of(text_key(key + " study")));
}

Expected<void> save_private(const std::filesystem::path& path, DcmFileFormat& file) {
  return write_file_with(path, [&](const std::filesystem::path& aside) -> Expected<void> {
    if (auto created = make_private_file(aside); !created) return created;
    const OFCondition status = file.saveFile(aside.c_str(), EXS_LittleEndianExplicit);
    if (status.good()) return {};
    return fail(Reason::cannot_write, fmt::format("{}: cannot be written: {}", path.string(), status.text()));
  });
}

}  // namespace helicarm::xray
