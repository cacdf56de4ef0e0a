// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>

#include "helicarm/image/image.h"

namespace helicarm {

/// OpenCV's view of the same pixels; nothing is copied, so the image must outlive it.
template <class T>
cv::Mat as_mat(Image<T>& image) {
  return {image.height(), image.width(), cv::DataType<T>::type, image.pixels().data()};
}

/// As above for reading only: OpenCV has no const matrix, so do not write through it.
template <class T>
cv::Mat as_mat(const Image<T>& image) {
  return {image.height(), image.width(), cv::DataType<T>::type, const_cast<T*>(image.pixels().data())};
}

}  // namespace helicarm
