// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "helicarm/core/failure.h"
#include "helicarm/xray/patient_study.h"

class DcmDataset;
class DcmFileFormat;
class DcmItem;
class DcmTagKey;

/// Objects of other classes than images: parts that all of them have. Functions throw BadInput
/// (cannot_write).
namespace helicarm::xray {

void put_in(DcmItem& item, const DcmTagKey& tag, const std::string& value);
/// The item `at` of a sequence, made if it is the next one.
DcmItem& item_in(DcmItem& item, const DcmTagKey& sequence, long at = 0);

/// At most sixteen characters, as a DS has.
std::string decimal_string(double value);

/// A text of this program beside a patient's: UTF-8, or with "?" for what the patient's character set may not
/// hold.
std::string own_text(const PatientStudy& patient_study, std::string text);

/// SOP Common, General Series and Equipment, with UIDs that follow from `content`, and the patient and study.
void put_object(DcmDataset& dataset, const char* sop_class, const std::string& modality,
                const std::string& content, const PatientStudy& patient_study);

/// Atomically and readable by its owner alone. Refuses cannot_write.
Expected<void> save_private(const std::filesystem::path& path, DcmFileFormat& file);

}  // namespace helicarm::xray
