// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/xray/xray_image.h"

namespace helicarm::pipeline {

/// Refuses images of different patients or studies (patient_mismatch), and one image as two views
/// (views_too_close; an unusable one as `rectification::check_usable`).
Expected<void> check_images_belong_together(const std::vector<const xray::XrayImage*>& images);

}  // namespace helicarm::pipeline
