// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "helicarm/core/json.h"
#include "helicarm/measures/in_bone.h"

namespace helicarm::case_registration {

/// Refuses (bad_value) a calibration's view of which registration.json states another camera: over 5 mm or
/// 1 degree off, so that one of both is of other images. Views that it does not name pass, and files of
/// earlier versions, which state no cameras. Fails as JsonReader.
Expected<void> check_same_views(const Json& registration, const std::string& origin,
                                std::span<const measures::NamedView> views);

}  // namespace helicarm::case_registration
