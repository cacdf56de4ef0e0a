// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/rectified_image.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "helicarm/image/grey_window.h"
#include "helicarm/image/opencv.h"

namespace helicarm::report {

image::Image<std::uint8_t> rectified_image(const pipeline::ViewResult& view) {
  const bool as_stored = !view.rectification || view.rectification->map.is_identity();
  const auto displayed = [&](const image::Image<float>& image) {
    return image::eight_bit(image, image::usual_window(image, view.xray_image->lowest));
  };
  if (as_stored) return displayed(view.xray_image->pixels);
  return displayed(rectification::resample(*view.xray_image, view.rectification->map));
}

image::Image<std::uint8_t> at_most(const image::Image<std::uint8_t>& grey, int side) {
  const int factor = (std::max(grey.width(), grey.height()) + side - 1) / side;
  if (factor <= 1) return grey;
  image::Image<std::uint8_t> small(std::max(1, grey.width() / factor), std::max(1, grey.height() / factor));
  cv::Mat target = image::as_mat(small);
  cv::resize(image::as_mat(grey), target, target.size(), 0, 0, cv::INTER_AREA);
  return small;
}

double round_below(double limit) {
  const double decade = std::pow(10, std::floor(std::log10(limit)));
  for (double factor : {5.0, 2.0})
    if (factor * decade <= limit) return factor * decade;
  return decade;
}

}  // namespace helicarm::report
