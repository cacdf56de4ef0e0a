// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/picture.h"

#include <cmath>

#include "helicarm/image/grey_window.h"

namespace helicarm {

Image<std::uint8_t> rectified_picture(const ViewResult& view) {
  const bool as_stored = !view.rectification || view.rectification->map.is_identity();
  const Image<float> picture =
      as_stored ? view.exposure->pixels : resample(*view.exposure, view.rectification->map);
  return eight_bit(picture, usual_window(picture, view.exposure->lowest));
}

double round_below(double limit) {
  const double decade = std::pow(10, std::floor(std::log10(limit)));
  for (double factor : {5.0, 2.0})
    if (factor * decade <= limit) return factor * decade;
  return decade;
}

}  // namespace helicarm
