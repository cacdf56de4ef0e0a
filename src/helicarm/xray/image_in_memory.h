// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "helicarm/xray/xray_image.h"

namespace helicarm::xray {

/// The image of a DICOM file in memory. Fails as `read_xray_image`.
Expected<XrayImage> image_of_dicom(const std::string& bytes, const std::string& view_name,
                                   std::optional<int> frame);

}  // namespace helicarm::xray
