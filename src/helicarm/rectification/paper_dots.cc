// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/paper_dots.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "helicarm/image/opencv.h"

namespace helicarm {

std::vector<Dot> find_dots_paper(const Image<float>& image, float lowest, float highest, double min_radius_px,
                                 double max_radius_px) {
  cv::Mat filtered;
  cv::medianBlur(as_mat(image), filtered, 5);
  cv::Mat grey;
  const double gain = 255.0 / std::max(1e-6, double(highest - lowest));
  filtered.convertTo(grey, CV_8U, gain, -gain * double(lowest));
  std::vector<cv::Vec3f> circles;
  const double canny_threshold = 60;
  const double votes = std::max(6.0, 1.2 * min_radius_px);
  cv::HoughCircles(grey, circles, cv::HOUGH_GRADIENT, 1, 2 * min_radius_px, canny_threshold, votes,
                   static_cast<int>(std::floor(min_radius_px)), static_cast<int>(std::ceil(max_radius_px)));
  std::vector<Dot> dots;
  for (const cv::Vec3f& circle : circles) {
    Dot dot;
    dot.centre_px = {double(circle[0]), double(circle[1])};
    dot.sigma_px = 0.45;
    dot.radius_px = double(circle[2]);
    dots.push_back(dot);
  }
  return dots;
}

}  // namespace helicarm
