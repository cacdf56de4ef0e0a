// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "helicarm/core/random.h"

namespace helicarm::xray {

/// New DICOM UID, 2.25.<128-bit random UUID in decimal> (PS3.5 B.2), from the system's entropy; independent
/// of host names.
std::string make_uid();

/// Reproducible variant.
std::string make_uid(RandomStream& random);

/// The UID of a key of 32 hexadecimal digits: the same for the same key.
std::string uid_of(const std::string& key);

/// First 128 bits of the SHA-256 of a text, as 32 hexadecimal digits: compares identifiers without keeping
/// them. Empty for an empty text.
std::string text_key(std::string_view text);

}  // namespace helicarm::xray
