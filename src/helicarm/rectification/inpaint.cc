// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/inpaint.h"

#include <cmath>

#include <opencv2/imgproc.hpp>
#include <opencv2/photo.hpp>

#include "helicarm/image/opencv.h"

namespace helicarm::rectification {

image::Image<float> inpainted(const image::Image<float>& image, const std::vector<detection::Dot>& dots) {
  constexpr double rim_px = 2;  // blur around a dot
  constexpr int reach_px = 3;
  image::Image<std::uint8_t> hidden(image.width(), image.height());
  cv::Mat mask = image::as_mat(hidden);
  for (const detection::Dot& dot : dots) {
    const cv::Point centre(static_cast<int>(std::lround(dot.centre_px.x())),
                           static_cast<int>(std::lround(dot.centre_px.y())));
    cv::circle(mask, centre, static_cast<int>(std::ceil(dot.radius_px + rim_px)), 255, cv::FILLED);
  }
  image::Image<float> filled = image;
  cv::Mat target = image::as_mat(filled);
  // Patch by patch: for a whole image of holes OpenCV's front is a list searched from its start.
  cv::Mat labels;
  cv::Mat boxes;
  cv::Mat centroids;
  const int patches = cv::connectedComponentsWithStats(mask, labels, boxes, centroids);
  for (int patch = 1; patch < patches; ++patch) {
    const auto side = [&](int which) { return boxes.at<int>(patch, which); };
    constexpr int margin = 3 * reach_px;
    const cv::Rect box =
        cv::Rect(side(cv::CC_STAT_LEFT) - margin, side(cv::CC_STAT_TOP) - margin,
                 side(cv::CC_STAT_WIDTH) + 2 * margin, side(cv::CC_STAT_HEIGHT) + 2 * margin) &
        cv::Rect(0, 0, mask.cols, mask.rows);
    cv::Mat repaired;
    cv::inpaint(image::as_mat(image)(box), mask(box), repaired, reach_px, cv::INPAINT_TELEA);
    repaired.copyTo(target(box), labels(box) == patch);
  }
  return filled;
}

}  // namespace helicarm::rectification
