// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/rectified_image.h"

#include <cmath>

#include "helicarm/image/grey_window.h"

namespace helicarm::report {

image::Image<std::uint8_t> rectified_image(const pipeline::ViewResult& view) {
  const bool as_stored = !view.rectification || view.rectification->map.is_identity();
  const image::Image<float> image = as_stored
                                        ? view.xray_image->pixels
                                        : rectification::resample(*view.xray_image, view.rectification->map);
  return image::eight_bit(image, image::usual_window(image, view.xray_image->lowest));
}

double round_below(double limit) {
  const double decade = std::pow(10, std::floor(std::log10(limit)));
  for (double factor : {5.0, 2.0})
    if (factor * decade <= limit) return factor * decade;
  return decade;
}

}  // namespace helicarm::report
