// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/dicom_text.h"

#include <algorithm>

namespace helicarm::xray {

std::string whole_characters(std::string text, std::size_t most) {
  std::ranges::replace(text, '\\', '/');
  if (text.size() <= most) return text;
  std::size_t end = most;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;
  return text.substr(0, end);
}

}  // namespace helicarm::xray
