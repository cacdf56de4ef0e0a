// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>

#include "helicarm/core/field.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::pipeline {

/// Options of a run. `--threads` is a flag of all commands.
inline constexpr std::array<Field<RunOptions>, 4> run_fields{
    bound<&RunOptions::method>({.name = "method",
                                .flag = "--method",
                                .range = {0, 1},
                                .step = 1,
                                .help = "best, or paper: the published recipe",
                                .words = rectification::method_words}),
    bound<&RunOptions::max_error_mm>({.name = "max_error_mm",
                                      .label = "Limit of a point's error",
                                      .flag = "--max-error",
                                      .unit = "mm",
                                      .range = {1e-6, 1000},
                                      .help = "Refuse when a point may be off by more, mm (95 %)"}),
    bound<&RunOptions::motion_sigma_mm>({.name = "motion_sigma_mm",
                                         .label = "Motion of an untracked bone",
                                         .flag = "--motion-sigma",
                                         .unit = "mm",
                                         .range = {0, 100},
                                         .help =
                                             "Standard deviation per axis of the motion of a bone without "
                                             "poses between the acquisitions, mm"}),
    bound<&RunOptions::threads>(
        {.name = "threads", .range = {0, 1024}, .step = 1, .help = "Threads to use; 0: all cores"})};

/// Whether two measurements may differ by their options alone; threads change no result.
inline bool give_the_same(const RunOptions& a, const RunOptions& b) {
  return std::ranges::all_of(run_fields, [&](const Field<RunOptions>& field) {
    return field.name == "threads" || field.get(a) == field.get(b);
  });
}

}  // namespace helicarm::pipeline
