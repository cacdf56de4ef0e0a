// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/guidance/poses.h"
#include "helicarm/operation/plan.h"
#include "helicarm/pipeline/calibration_cache.h"

namespace helicarm::operation {

/// A view in the form of case.json.
struct CaseImage {
  std::string name;
  std::filesystem::path image;
  guidance::Poses poses;
};

/// Makes `folder` a self-contained case (docs/formats.md): images, calibrator, plate, case.json. Tunnels
/// without picks for both ends are left out. Refuses cannot_write, missing_file.
Expected<void> write_operation_case(const std::filesystem::path& folder, const OperationPlan& plan,
                                    const std::vector<CaseImage>& images, const guidance::Poses& now,
                                    const std::vector<verification::ToolLine>& tool_lines);

/// The digest excludes the timing, so equal cases have equal digests.
struct CaseRun {
  pipeline::Result result;
  std::string digest;
};
/// Reads the case and runs it; writes nothing.
Expected<CaseRun> recompute_case(const std::filesystem::path& folder, const OperationPlan& plan,
                                 pipeline::CalibrationCache& cache);
/// As above, and writes result.json and the report.
Expected<CaseRun> run_operation_case(const std::filesystem::path& folder, const OperationPlan& plan,
                                     pipeline::CalibrationCache& cache);

}  // namespace helicarm::operation
