// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/xray/write_dicom.h"

namespace helicarm::xray {

/// An image made of another one, without its patient data: pixels in the source's range, shifted to begin at
/// 0, with the source's geometry, modality and technique. UIDs, also those of the study and the source, are
/// made from those of the source and the content, always the same, and do not disclose them.
DerivedImage derived_image(const XrayImage& source, const image::Image<float>& pixels,
                           std::string description);

/// The image as it was read, without anything of its file but pixels and geometry: no patient, no date, no
/// time. UIDs are made from those of the source and do not disclose them; the patient's ID is numbered by the
/// first image with an equal one.
class DeIdentification {
 public:
  DerivedImage operator()(const XrayImage& source);

 private:
  std::vector<std::string> patients_;
};

}  // namespace helicarm::xray
