// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/rectification/distortion_map.h"
#include "helicarm/xray/write_dicom.h"

namespace helicarm::rectification {

/// The image resampled to rectified pixels (Eq. 3), to be written as DICOM: grey values as in the source,
/// pixel size of the map where it is that of the detector, no patient data.
xray::DerivedImage rectified_dicom(const xray::XrayImage& xray_image, const DistortionMap& map,
                                   std::string description);

}  // namespace helicarm::rectification
