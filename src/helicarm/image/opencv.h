// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>

#include "helicarm/image/image.h"

namespace helicarm::image {

/// OpenCV header on the same pixels, without a copy; the image must outlive it.
template <class T>
cv::Mat as_mat(Image<T>& image) {
  return {image.height(), image.width(), cv::DataType<T>::type, image.pixels().data()};
}

/// Read-only: OpenCV has no const matrix, so the caller must not write to it.
template <class T>
cv::Mat as_mat(const Image<T>& image) {
  return {image.height(), image.width(), cv::DataType<T>::type, const_cast<T*>(image.pixels().data())};
}

}  // namespace helicarm::image
