// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/run_polarity.h"

#include <algorithm>

#include "helicarm/xray/read_dicom.h"

namespace helicarm::xray {
namespace {

bool says_inverted(const Warning& warning) {
  return warning.reason == Reason::tag_disagrees && warning.message.ends_with(inverted_note);
}

}  // namespace

bool was_inverted(const XrayImage& xray_image) {
  return std::ranges::any_of(xray_image.warnings, says_inverted);
}

void take_polarity(XrayImage& xray_image, bool run_is_inverted) {
  const bool is_inverted = std::erase_if(xray_image.warnings, says_inverted) > 0;
  if (is_inverted != run_is_inverted) invert(xray_image);
}

}  // namespace helicarm::xray
