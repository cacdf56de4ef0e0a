// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/pipeline/result.h"

namespace helicarm::report {

// Each returns one part of the report as HTML, empty without data.
std::string summary_section(const pipeline::Result& result);
std::string views_section(const pipeline::Result& result);
std::string tables_section(const pipeline::Result& result);
std::string distortion_section(const pipeline::Result& result);
std::string notes_section(const pipeline::Result& result);
std::string warnings_section(const pipeline::Result& result);

}  // namespace helicarm::report
