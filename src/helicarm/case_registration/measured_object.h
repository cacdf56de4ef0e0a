// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/case_registration/measure_case.h"
#include "helicarm/report/exports.h"

namespace helicarm::case_registration {

/// The located point, the planned point (also as "MODEL: NAME") or the model's centre of this name, in the
/// calibrator's frame, with the motions of its bone if poses follow it. Refuses bad_value where there is none
/// that was located, with the names that there are, and name_clash where there are several.
Expected<report::SpacingObject> object_named(const Measurement& measured, const std::string& name);

}  // namespace helicarm::case_registration
