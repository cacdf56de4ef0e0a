// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/pipeline/case.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::pipeline {

/// The image of a view with what the view states of it. Fails as `read_xray_image`, or with bad_value where
/// the file contradicts the view.
Expected<xray::XrayImage> image_of(const CaseView& view);

/// Likewise its plate image, of the same C-arm position; the view has one.
Expected<xray::XrayImage> plate_image_of(const CaseView& view);

}  // namespace helicarm::pipeline
