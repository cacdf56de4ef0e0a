// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/rectification/rectify.h"

namespace helicarm::python {

/// "best" or "paper"; InputError (usage) for another word.
rectification::Method method_of(const std::string& word);

}  // namespace helicarm::python
