// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "helicarm/xray/dicom_elements.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm {

/// When the image was acquisition: by Acquisition DateTime, else Acquisition Date and Time, else Content Date
/// and Time; with Timezone Offset From UTC where the time names none. What is no whole date and time, to the
/// second, counts as absent: images are measured without it.
std::optional<AcquisitionTime> acquisition_time(const DicomElements& elements);

/// As an Acquisition DateTime says it (UTC, microseconds).
std::string dicom_date_time(double seconds_since_1970);

}  // namespace helicarm
