// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/xray/xray_image.h"

namespace helicarm::track {

/// Short digests of one frame's images, a view each: by them a later run sees that an image has changed.
using ImageKeys = std::vector<std::string>;
ImageKeys keys_of(const std::vector<xray::XrayImage>& images);

/// images.csv: a row for each frame and view.
std::string image_keys_header();
std::string image_keys_rows(int frame, const std::vector<std::string>& views, const ImageKeys& keys);
/// Of the frames in the text that are complete, in order, up to the first that is not of `frames`.
std::vector<ImageKeys> image_keys_from(const std::string& text, const std::vector<std::string>& views,
                                       const std::vector<int>& frames);

/// "frame 7: the image of cam1 is another than in the interrupted run: ..."; empty where the keys agree.
std::string changed_image(int frame, const std::vector<std::string>& views, const ImageKeys& kept,
                          const ImageKeys& now);

}  // namespace helicarm::track
