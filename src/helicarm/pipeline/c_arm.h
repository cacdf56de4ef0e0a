// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "helicarm/calibration/c_arm_model.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::pipeline {

/// A case's acquisitions for a C-arm's record, estimated without it, and the findings of the measurement.
struct CArmAcquisitions {
  std::vector<calibration::HistoryEntry> entries;
  std::vector<Finding> warnings;
};

/// Measures the case in a folder, or reads a result.json or sweep.json (or a folder that holds one and no
/// case). Fails as `read_case`, `measure` and `acquisitions_of_result`, with a refused case's own failure,
/// and with residual_too_large where its views say nothing of the C-arm.
Expected<CArmAcquisitions> c_arm_acquisitions(const std::filesystem::path& from, unsigned threads);

/// The model of a record; a record without acquisitions is too_few_views. `origin`: the record's file.
Expected<calibration::CArmModel> model_of_record(const calibration::CArmHistory& record,
                                                 const std::string& origin);

/// Acquisitions beside a record, whose own entries of these images do not count. Fails as `model_of_record`.
Expected<calibration::CArmCheck> check_against_record(std::vector<calibration::HistoryEntry> acquired,
                                                      calibration::CArmHistory record,
                                                      const std::string& origin);

/// c_arm_changed, with the worst acquisition's figures; nothing if it has not.
std::optional<Failure> c_arm_change(const calibration::CArmCheck& check);

}  // namespace helicarm::pipeline
