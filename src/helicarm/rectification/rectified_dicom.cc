// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/rectified_dicom.h"

#include "helicarm/rectification/rectify.h"
#include "helicarm/xray/derived_image.h"

namespace helicarm::rectification {

xray::DerivedImage rectified_dicom(const xray::XrayImage& xray_image, const DistortionMap& map,
                                   std::string description) {
  xray::DerivedImage image =
      xray::derived_image(xray_image, resample(xray_image, map), std::move(description));
  if (map.rectified_plane == RectifiedPlane::detector && map.rectified_pixel_mm)
    image.acquisition.pixel_mm = Eigen::Vector2d::Constant(*map.rectified_pixel_mm);
  return image;
}

}  // namespace helicarm::rectification
