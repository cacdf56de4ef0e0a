// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "helicarm/xray/dicom_elements.h"

namespace helicarm {

/// A DICOM X-ray whose structure, sizes and pixel module have been found sound; its views point into the
/// bytes.
struct DicomOutline {
  DicomElements elements;
  int rows = 0;
  int columns = 0;
  int frames = 1;
  int bits_allocated = 16;  ///< 8 or 16
  int bits_stored = 16;     ///< 8 .. bits_allocated
  bool is_signed = false;
  bool monochrome1 = false;
  std::string_view pixel_data;  ///< all frames, for the native transfer syntaxes

  bool encapsulated() const { return !elements.fragments.empty(); }
};

/// Whether objects of this SOP class may be an X-ray that is read here: XA, RF, CR, DX or secondary capture.
bool is_xray_class(std::string_view sop_class);

/// What a file is to be an image of.
enum class DicomKind { xray, ct };

/// SOP class of a CT slice.
inline constexpr std::string_view ct_class = "1.2.840.10008.5.1.4.1.1.2";

/// Checks a whole file in memory before anything is decoded: `walk_dicom`, then what it is an image of and
/// how the pixels are stored. Refuses: not_an_image, truncated, bad_size (Rows, Columns, more than 64 MiB a
/// frame), bad_value, unsupported (not a grey X-ray or secondary capture, or not a CT slice).
Expected<DicomOutline> check_dicom(std::string_view bytes, const std::string& origin,
                                   DicomKind kind = DicomKind::xray);

}  // namespace helicarm
