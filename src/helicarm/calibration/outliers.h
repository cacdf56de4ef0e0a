// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/calibration/refine.h"

namespace helicarm {

/// Index of an observation: view, then place among that view's observations.
struct ObservationIndex {
  std::size_t view;
  std::size_t observation;
};

/// A fit without the observations that do not belong to it; `removed` counts in the problems as they were
/// given.
struct CleanFit {
  std::vector<ViewProblem> problems;
  Refinement fit;
  std::vector<ObservationIndex> removed;
};

/// Generalised extreme studentised deviate test (Rosner 1983): the worst observation is removed again and
/// again, at most a third of all and never below `least_kept` of a view; then the last removal that mattered
/// decides how many were false, so that several cannot hide one another.
Expected<CleanFit> refine_without_outliers(std::vector<ViewProblem> problems, const CommonPrior& common,
                                           double probability, std::size_t least_kept);

}  // namespace helicarm
