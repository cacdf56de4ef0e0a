// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include <opencv2/core.hpp>

#include "helicarm/core/failure.h"
#include "helicarm/image/grey_image.h"

namespace helicarm::image {

std::string encode_png(const Image<std::uint8_t>& grey);
std::string encode_png(const Image<std::uint16_t>& grey);
/// 8UC3 in RGB order.
std::string encode_png(const cv::Mat& rgb);

bool is_png(std::string_view bytes);

/// 8 or 16-bit grey, or RGB whose three channels are equal. Refuses: truncated, bad_size, bad_value
/// (damaged), unsupported (palette, alpha, fewer than 8 bits, true colour, an EXIF orientation other than 1).
/// `origin` begins each message.
Expected<GreyImage> decode_png(std::string_view bytes, const std::string& origin);

}  // namespace helicarm::image
