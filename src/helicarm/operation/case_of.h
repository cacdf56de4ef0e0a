// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>

#include "helicarm/operation/plan.h"
#include "helicarm/pipeline/measure.h"

namespace helicarm::operation {

/// An accepted image.
struct CaseImage {
  std::string name;
  std::filesystem::path image;
  std::string digest;  ///< of the file when it was received
  guidance::Poses poses;
};

/// Digest of each file by its name.
using Digests = std::map<std::string, std::string>;

/// Calibrator and plate of a plan, as a case of the operation holds them.
struct PlanFiles {
  std::string calibrator_name;  ///< of a built-in, or a file of `files`
  phantom::Calibrator calibrator;
  std::optional<std::string> plate_name;
  std::optional<phantom::Plate> plate;
  std::map<std::string, std::string> files;  ///< contents by name
};

/// As the plan names them. Fails as `read_calibrator` and `read_plate`, and with name_clash for two files of
/// one name.
Expected<PlanFiles> files_of(const OperationPlan& plan);
/// The same of a case's folder, where files lie by their names alone.
Expected<PlanFiles> files_of_case(const OperationPlan& plan, const std::filesystem::path& folder);

/// The case of a measurement, in `folder`. Tunnels without picks for both ends are left out. Fails as
/// `checked_case`.
Expected<pipeline::Case> operation_case(const std::filesystem::path& folder, const OperationPlan& plan,
                                        const PlanFiles& files, const std::vector<CaseImage>& images,
                                        const guidance::Poses& now,
                                        const std::vector<guidance::ToolLine>& tool_lines);

/// The bytes of a received image. Refuses as `read_file`, and (image_changed) a file that is no longer the
/// one that was received.
Expected<std::string> received_image(const std::filesystem::path& image, const std::string& digest);

/// Makes the case's folder, self-contained (docs/formats.md), which only the owner can read: images,
/// calibrator, plate, case.json; returns their digests. Refuses cannot_write, also for a folder that exists,
/// and as `received_image`.
Expected<Digests> write_operation_case(const pipeline::Case& written, const PlanFiles& files,
                                       const std::vector<CaseImage>& images);

/// Refuses (image_changed) a folder whose files are not those.
Expected<void> check_digests(const std::filesystem::path& folder, const Digests& files);

/// Measures by the calibration of `earlier`, if there is one: of the same images.
Expected<pipeline::Result> measure_by_plan(const pipeline::Case& the_case, const OperationPlan& plan,
                                           const std::optional<pipeline::Result>& earlier);

/// result.json without its timing, which differs from run to run.
Json without_timing(Json result);
/// Of that: equal cases have equal digests.
std::string digest_of(const Json& result);

/// Writes result.json and the report into the case's folder; returns their digests.
Expected<Digests> write_result(const pipeline::Result& result, const std::filesystem::path& folder);

}  // namespace helicarm::operation
