// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/guidance/poses.h"
#include "helicarm/operation/plan.h"
#include "helicarm/pipeline/calibration_cache.h"

namespace helicarm {

/// A view as case.json tells it.
struct CaseImage {
  std::string name;
  std::filesystem::path image;
  Poses poses;
};

/// Makes `folder` a case of its own (docs/formats.md): images, calibrator, plate, case.json; tunnels whose
/// ends nobody picked yet are left out. Refuses cannot_write, missing_file.
Expected<void> write_operation_case(const std::filesystem::path& folder, const OperationPlan& plan,
                                    const std::vector<CaseImage>& images, const Poses& now,
                                    const std::vector<ToolLine>& tool_lines);

/// The digest is of the result without its timing: the same case gives the same one.
struct CaseRun {
  Result result;
  std::string digest;
};
/// Reads the case and runs it; writes nothing.
Expected<CaseRun> recompute_case(const std::filesystem::path& folder, const OperationPlan& plan,
                                 CalibrationCache& cache);
/// The same, and writes result.json and the report.
Expected<CaseRun> run_operation_case(const std::filesystem::path& folder, const OperationPlan& plan,
                                     CalibrationCache& cache);

}  // namespace helicarm
