// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/xray/transfer_syntax.h"

namespace helicarm::xray {

/// The words (little-endian, `word_bytes` 1 or 2) of one compressed grey frame of width x height pixels.
/// Refuses: truncated, bad_value (another size, damaged). Not for `Coding::native`.
Expected<std::string> decode_compressed(std::string bytes, Coding coding, const Eigen::Vector2i& size,
                                        int word_bytes, const std::string& origin);

/// A byte for each pixel, 0 or not, of one compressed frame of Bits Allocated 1. In RLE and deflated frames
/// the bits are packed (CP 2301), or of an RLE encoder that expands them a byte each; other codings hold
/// pixels.
Expected<std::string> decode_compressed_bits(std::string bytes, Coding coding, const Eigen::Vector2i& size,
                                             const std::string& origin);

}  // namespace helicarm::xray
