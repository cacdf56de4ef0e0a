// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>

#include "helicarm/guidance/poses.h"
#include "helicarm/operation/plan.h"
#include "helicarm/pipeline/calibration_cache.h"

namespace helicarm::operation {

/// A view in the form of case.json.
struct CaseImage {
  std::string name;
  std::filesystem::path image;
  std::string digest;  ///< of the file when it was received
  guidance::Poses poses;
};

/// Digest of each file by its name.
using Digests = std::map<std::string, std::string>;

/// case.json; calibrator and plate as the plan names them.
Json operation_case_json(const OperationPlan& plan, const std::vector<CaseImage>& images,
                         const guidance::Poses& now, const std::vector<verification::ToolLine>& tool_lines);

/// The bytes of a received image. Refuses as `read_file`, and (image_changed) a file that is no longer the
/// one that was received.
Expected<std::string> received_image(const std::filesystem::path& image, const std::string& digest);

/// Makes `folder` a self-contained case (docs/formats.md) that only the owner can read: images, calibrator,
/// plate, case.json; returns their digests. Tunnels without picks for both ends are left out. Refuses
/// cannot_write, also for a folder that exists; missing_file; and as `received_image`.
Expected<Digests> write_operation_case(const std::filesystem::path& folder, const OperationPlan& plan,
                                       const std::vector<CaseImage>& images, const guidance::Poses& now,
                                       const std::vector<verification::ToolLine>& tool_lines);

/// Refuses (image_changed) a folder whose files are not those.
Expected<void> check_digests(const std::filesystem::path& folder, const Digests& files);

/// The digest excludes the timing, so equal cases have equal digests.
struct CaseRun {
  pipeline::Result result;
  std::string digest;
  Digests files = {};  ///< that were written
};
/// Reads the case and runs it; writes nothing.
Expected<CaseRun> recompute_case(const std::filesystem::path& folder, const OperationPlan& plan,
                                 pipeline::CalibrationCache& cache);
/// As above, and writes result.json and the report.
Expected<CaseRun> run_operation_case(const std::filesystem::path& folder, const OperationPlan& plan,
                                     pipeline::CalibrationCache& cache);

}  // namespace helicarm::operation
