// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::case_registration {

/// Everything computed from a case: points and tunnels, and the registration of its models by the same
/// calibration, options and limits.
struct Measurement {
  pipeline::Result result;                       ///< `with_models`
  std::optional<CaseRegistration> registration;  ///< nothing: no models, or refused before
  std::vector<guidance::Poses> poses = {};       ///< of each view, at its acquisition
};

/// Calibrates once, locates the picks and registers the models, if the case names any. A refusal is in
/// `result.failure`, with all that was computed before it; unreadable input (exit code 2) fails.
Expected<Measurement> measure_case(const pipeline::Case& the_case, const RegisterOptions& options,
                                   const Progress& progress = {});

/// The result with the plans' points and tunnels of the models that were not refused (or for a tunnel_breach
/// alone), and with the
/// registration's findings; refused if a model is.
pipeline::Result with_models(pipeline::Result result, const CaseRegistration& registration);

/// Writes registration.json beside result.json, report and overlays of the models into registration/, or
/// removes those of an earlier measurement where there are none.
Expected<void> write_models(const std::optional<CaseRegistration>& registration,
                            const std::filesystem::path& folder);

}  // namespace helicarm::case_registration
