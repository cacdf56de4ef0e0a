// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "helicarm/xray/dicom_elements.h"

namespace helicarm::xray {

/// Fragments of one frame, as indices into DicomElements::fragments: from `first` to before `last`.
struct FrameFragments {
  std::size_t first = 0;
  std::size_t last = 0;
};

struct EncapsulatedFrames {
  std::vector<FrameFragments> frames;  ///< as many as were asked for
  std::size_t images = 0;              ///< compressed images that begin in the fragments; may be more
};

/// The fragments of every frame of encapsulated Pixel Data (PS3.5 A.4). Where frames are not one fragment
/// each: by the table of their offsets, else by where compressed images begin. Empty fragments hold nothing.
/// Throws BadInput: truncated (fewer images than frames), bad_value (the frames cannot be distinguished).
EncapsulatedFrames fragments_of_frames(const DicomElements& elements, int frames);

}  // namespace helicarm::xray
