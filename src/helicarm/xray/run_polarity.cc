// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/run_polarity.h"

#include "helicarm/xray/read_dicom.h"

namespace helicarm::xray {

void take_polarity(XrayImage& xray_image, bool run_is_inverted) {
  if (xray_image.inverted.has_value() != run_is_inverted) invert(xray_image);
  if (xray_image.inverted) std::erase(xray_image.warnings, *xray_image.inverted);
  xray_image.inverted.reset();
}

}  // namespace helicarm::xray
