// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>

#include "helicarm/fiducials/fiducial.h"

namespace helicarm::fiducials {

/// Of FiducialStatus, in its order, in files and in Python.
inline constexpr std::array<std::string_view, 5> status_words{"used", "occluded", "outside", "rejected",
                                                              "not_found"};

inline std::string_view word(FiducialStatus status) { return status_words[std::size_t(status)]; }

}  // namespace helicarm::fiducials
