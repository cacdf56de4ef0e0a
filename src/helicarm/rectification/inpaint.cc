// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/inpaint.h"

#include <cmath>

#include <opencv2/imgproc.hpp>
#include <opencv2/photo.hpp>

#include "helicarm/image/opencv.h"

namespace helicarm {

Image<float> inpainted(const Image<float>& image, const std::vector<Dot>& dots) {
  constexpr double rim_px = 2;  // the blur about a dot
  Image<std::uint8_t> hidden(image.width(), image.height());
  cv::Mat mask = as_mat(hidden);
  for (const Dot& dot : dots) {
    const cv::Point centre(static_cast<int>(std::lround(dot.centre_px.x())),
                           static_cast<int>(std::lround(dot.centre_px.y())));
    cv::circle(mask, centre, static_cast<int>(std::ceil(dot.radius_px + rim_px)), 255, cv::FILLED);
  }
  Image<float> filled(image.width(), image.height());
  cv::Mat target = as_mat(filled);
  cv::inpaint(as_mat(image), mask, target, 3, cv::INPAINT_TELEA);
  return filled;
}

}  // namespace helicarm
