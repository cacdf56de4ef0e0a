// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "helicarm/xray/dicom_elements.h"
#include "helicarm/xray/frame_fragments.h"

namespace helicarm::xray {

/// A DICOM X-ray with valid structure, sizes and pixel module; its views point into the bytes.
struct DicomOutline {
  DicomElements elements;
  int rows = 0;
  int columns = 0;
  int frames = 1;
  int bits_allocated = 16;  ///< 8 or 16
  int bits_stored = 16;     ///< 8 .. bits_allocated
  int lowest_bit = 0;       ///< of the stored bits, as High Bit states
  bool is_signed = false;
  bool monochrome1 = false;
  std::string_view pixel_data;                  ///< all frames, for the native transfer syntaxes
  std::vector<FrameFragments> frame_fragments;  ///< of each frame, for the others
  std::vector<Warning> warnings;                ///< irregular_file, surplus_data

  bool encapsulated() const { return !elements.fragments.empty(); }
};

/// Whether this SOP class is supported: XA, RF, CR, DX or secondary capture.
bool is_xray_class(std::string_view sop_class);

/// Expected content of a file.
enum class DicomKind { xray, ct };

/// SOP class of a CT slice.
inline constexpr std::string_view ct_class = "1.2.840.10008.5.1.4.1.1.2";

/// Checks a whole file in memory before decoding: `walk_dicom`, then the kind of image and the pixel storage.
/// Refuses: not_an_image, truncated, bad_size (Rows, Columns, more than 64 MiB a frame), bad_value,
/// unsupported (not a grey X-ray or secondary capture, or not a CT slice).
Expected<DicomOutline> check_dicom(std::string_view bytes, const std::string& origin,
                                   DicomKind kind = DicomKind::xray);

}  // namespace helicarm::xray
