// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <string>

#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/operation/session_records.h"
#include "helicarm/phantom/schemas.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/sweep/sweep.h"

namespace helicarm::operation {

/// The JSON Schemas of the files that are read or written, by the file's name without .json.
inline const std::map<std::string, std::function<Json()>>& schemas() {
  static const std::map<std::string, std::function<Json()>> by_file{
      {"calibrator", phantom::calibrator_schema},
      {"case", pipeline::case_schema},
      {"machine", calibration::history_schema},
      {"plan", plan_schema},
      {"plate", phantom::plate_schema},
      {"registration", case_registration::registration_schema},
      {"result", pipeline::result_schema},
      {"session", session_schema},
      {"sweep", sweep::sweep_schema}};
  return by_file;
}

}  // namespace helicarm::operation
