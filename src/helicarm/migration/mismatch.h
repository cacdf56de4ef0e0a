// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/migration/exam.h"

namespace helicarm::migration {

/// Why a segment's markers have no rigid counterpart in the second examination: another unit of length, a
/// mirrored examination, or the markers of another of its segments. Empty where none of these explains it.
std::string mismatch_cause(const std::vector<Marker>& first, const Exam& second, const std::string& segment);

}  // namespace helicarm::migration
