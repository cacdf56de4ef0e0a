// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/xray/write_dicom.h"

namespace helicarm::xray {

/// An image made of another one, without its patient data: pixels in the source's range, shifted to begin at
/// 0, with the source's geometry.
DerivedImage derived_image(const XrayImage& source, const image::Image<float>& pixels,
                           std::string description);

/// The image as it was read, without anything of its file but pixels and geometry: no patient, no date, no
/// time. UIDs and the patient's ID are numbered by the first image with equal ones.
class DeIdentification {
 public:
  DerivedImage operator()(const XrayImage& source);

 private:
  std::vector<std::string> patients_, studies_, instances_;
};

}  // namespace helicarm::xray
