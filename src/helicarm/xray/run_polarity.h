// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "helicarm/xray/xray_image.h"

namespace helicarm::xray {

/// How the warning of an image ends whose metal looks bright, so that its reader inverted it.
inline constexpr std::string_view inverted_note = "metal is bright; the grey values were inverted";

/// Whether the reader inverted an image because its metal looks bright. A file that states its polarity is
/// never inverted for its looks.
bool was_inverted(const XrayImage& xray_image);

/// The image with the polarity of its run: stored values inverted, or not, whatever this frame alone looks
/// like. The reader's warning is removed; the run has one of its own.
void take_polarity(XrayImage& xray_image, bool run_is_inverted);

}  // namespace helicarm::xray
