// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "helicarm/core/failure.h"
#include "helicarm/image/grey_image.h"

namespace helicarm::xray {

/// Whether the bytes are a NRRD file (Teem) of grey images: two axes and a list of images, as 3D Slicer
/// writes sequences (.seq.nrrd) with a third axis of one slice; or one image. A volume is none.
bool is_nrrd_sequence(std::string_view bytes);

/// The same file with its values unpacked, so that each image is found by its place. Throws BadInput:
/// unsupported (an encoding other than raw and gzip, values in another file, a type other than integers of 8
/// or 16 bits), bad_value, bad_size, truncated, surplus_data.
std::string unpacked_sequence(std::string bytes, const std::string& origin);

/// Of an unpacked or packed file; throws as `unpacked_sequence`.
int images_of_sequence(std::string_view bytes, const std::string& origin);

/// By its index from 0, of an unpacked file; throws bad_value where an image has negative values.
image::GreyImage image_of_sequence(std::string_view unpacked, int index, const std::string& origin);

}  // namespace helicarm::xray
