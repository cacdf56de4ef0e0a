// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/calibration/refine.h"

namespace helicarm::calibration {

/// View, and index among its observations.
struct ObservationIndex {
  std::size_t view;
  std::size_t observation;
};

/// A fit without outliers; `removed` are indices into the problems before the removal.
struct CleanFit {
  std::vector<ViewProblem> problems;
  Refinement fit;
  std::vector<ObservationIndex> removed;
};

/// Generalised extreme studentised deviate test (Rosner 1983): removes the worst observation repeatedly, up
/// to a third of all, keeping `least_kept` in each view. The outliers are all up to the last significant
/// removal, which prevents masking.
Expected<CleanFit> refine_without_outliers(const std::vector<ViewProblem>& problems,
                                           const CommonPrior& common, double probability,
                                           std::size_t least_kept);

}  // namespace helicarm::calibration
