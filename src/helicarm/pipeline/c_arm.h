// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/calibration/c_arm_model.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::pipeline {

/// A case's acquisitions for a C-arm's record, estimated without it, and the findings of the measurement.
struct CArmAcquisitions {
  std::vector<calibration::HistoryEntry> entries;
  std::vector<Finding> warnings;
  std::optional<calibration::RunIsocentre> run = {};  ///< of a run of images
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

/// What a check cannot see: acquisitions without positioner angles, each of which counts as a position of its
/// own (intrinsics_weak, with the standard deviation of their prediction), and maps that it does not compare
/// (plate_mismatch).
std::vector<Warning> limits_of(const calibration::CArmCheck& check);

/// Adds acquisitions to a record, which is made where there is none. Fails with c_arm_changed, and adds
/// nothing, where they lie beyond what the record predicts and its tolerances; else as
/// `calibration::add_to_history`. `date`: of the acquisitions, like 2026-11-26; by default today.
Expected<calibration::HistoryGrowth> add_to_record(const std::filesystem::path& record,
                                                   const CArmAcquisitions& acquired,
                                                   const std::optional<std::string>& date = {});

/// Adds a measurement's acquisitions to the record that it was made with; none where the measurement found
/// the C-arm changed.
Expected<calibration::HistoryGrowth> add_to_record(const std::filesystem::path& record,
                                                   const Result& measured);

/// c_arm_changed, with the worst acquisition's figures; nothing if it has not.
std::optional<Failure> c_arm_change(const calibration::CArmCheck& check);

}  // namespace helicarm::pipeline
