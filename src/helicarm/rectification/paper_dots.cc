// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/paper_dots.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "helicarm/image/opencv.h"

namespace helicarm::rectification {

std::vector<detection::Dot> find_dots_paper(const image::Image<float>& image, float lowest, float highest,
                                            double min_radius_px, double max_radius_px) {
  cv::Mat filtered;
  cv::medianBlur(image::as_mat(image), filtered, 5);
  // To eight bits as for display: the square root raises dark values.
  cv::Mat lifted = cv::max(filtered - double(lowest), 0.0) / std::max(1e-6, double(highest - lowest));
  cv::sqrt(lifted, lifted);
  cv::Mat grey;
  lifted.convertTo(grey, CV_8U, 255);
  // The Hough transform needs a radius of a few pixels.
  const double zoom = min_radius_px < 4 ? 2 : 1;
  if (zoom > 1) cv::resize(grey, grey, {}, zoom, zoom, cv::INTER_LINEAR);
  std::vector<cv::Vec3f> circles;
  const double canny_threshold = 50;
  const double votes = std::max(6.0, 1.2 * zoom * min_radius_px);
  cv::HoughCircles(grey, circles, cv::HOUGH_GRADIENT, 1, 2 * zoom * min_radius_px, canny_threshold, votes,
                   static_cast<int>(std::floor(zoom * min_radius_px)),
                   static_cast<int>(std::ceil(zoom * max_radius_px)));
  std::vector<detection::Dot> dots;
  for (const cv::Vec3f& circle : circles) {
    detection::Dot dot;
    dot.centre_px = {(double(circle[0]) + 0.5) / zoom - 0.5, (double(circle[1]) + 0.5) / zoom - 0.5};
    dot.sigma_px = 0.45;
    dot.radius_px = double(circle[2]) / zoom;
    dots.push_back(dot);
  }
  return dots;
}

}  // namespace helicarm::rectification
