// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/paper_dots.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "helicarm/image/opencv.h"

namespace helicarm::rectification {

namespace {

constexpr double canny_threshold =
    50;  // the upper one; the lower is half of it, as in OpenCV's Hough transform

cv::Mat median_of(const image::Image<float>& image) {
  cv::Mat filtered;
  cv::medianBlur(image::as_mat(image), filtered, 5);
  return filtered;
}

/// To eight bits as for display: the square root raises dark values.
cv::Mat lifted(const cv::Mat& image, float lowest, float highest) {
  cv::Mat roots = cv::max(image - double(lowest), 0.0) / std::max(1e-6, double(highest - lowest));
  cv::sqrt(roots, roots);
  cv::Mat grey;
  roots.convertTo(grey, CV_8U, 255);
  return grey;
}

/// The Hough transform needs a radius of a few pixels.
double zoom_for(double min_radius_px) { return min_radius_px < 4 ? 2 : 1; }

cv::Mat enlarged(cv::Mat grey, double zoom) {
  if (zoom > 1) cv::resize(grey, grey, {}, zoom, zoom, cv::INTER_LINEAR);
  return grey;
}

image::Image<std::uint8_t> image_of(const cv::Mat& grey) {
  image::Image<std::uint8_t> image(grey.cols, grey.rows);
  grey.copyTo(image::as_mat(image));
  return image;
}

}  // namespace

std::vector<detection::Dot> find_dots_paper(const image::Image<float>& image, float lowest, float highest,
                                            double min_radius_px, double max_radius_px) {
  const double zoom = zoom_for(min_radius_px);
  const cv::Mat grey = enlarged(lifted(median_of(image), lowest, highest), zoom);
  std::vector<cv::Vec3f> circles;
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

PaperStages paper_stages(const image::Image<float>& image, float lowest, float highest,
                         const std::vector<detection::Dot>& circles) {
  constexpr double searched_from = 0.7;  // of the radius, as in `rectify`
  double radius = 0;
  for (const detection::Dot& circle : circles) radius += circle.radius_px / double(circles.size());
  const cv::Mat median = lifted(median_of(image), lowest, highest);
  cv::Mat edges;
  cv::Canny(enlarged(median, zoom_for(searched_from * radius)), edges, canny_threshold / 2, canny_threshold);
  cv::Mat drawn(image.height(), image.width(), CV_8U, cv::Scalar(0));
  constexpr int bits = 4;  // of a pixel's fraction
  for (const detection::Dot& circle : circles)
    cv::circle(drawn,
               cv::Point(int(std::lround(circle.centre_px.x() * (1 << bits))),
                         int(std::lround(circle.centre_px.y() * (1 << bits)))),
               int(std::lround(circle.radius_px * (1 << bits))), 255, cv::FILLED, cv::LINE_AA, bits);
  return {displayed(image, lowest, highest), image_of(median), image_of(edges), image_of(drawn)};
}

image::Image<std::uint8_t> displayed(const image::Image<float>& image, float lowest, float highest) {
  return image_of(lifted(image::as_mat(image), lowest, highest));
}

}  // namespace helicarm::rectification
