// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "helicarm/xray/dicom_elements.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::xray {

/// Acquisition time: Acquisition DateTime, else Acquisition Date and Time, else Content Date and Time;
/// Timezone Offset From UTC applies where the time has no offset. A value without a complete date and time to
/// the second counts as absent: images are processed without it.
std::optional<AcquisitionTime> acquisition_time(const DicomElements& elements);

/// In the format of Acquisition DateTime (UTC, microseconds).
std::string dicom_date_time(double seconds_since_1970);

/// A time as DICOM writes it, with the digits of its resolution.
struct WrittenTime {
  std::string date, time;      ///< YYYYMMDD, HHMMSS.F
  std::string offset;          ///< +0000, or empty: the source did not state its offset from UTC
  bool is_of_content = false;  ///< Content Date and Time, not that of the acquisition
};
WrittenTime written_time(const AcquisitionTime& time);

}  // namespace helicarm::xray
