// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/refused_run.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include <fmt/format.h>

namespace helicarm::sweep {
namespace {

/// Of the refused images those of the most frequent of these reasons, or of all.
std::vector<std::size_t> most_frequent(const std::vector<FrameEstimate>& estimates,
                                       const std::set<Reason>& reasons = {}) {
  std::map<Reason, std::vector<std::size_t>> images;
  for (std::size_t i = 0; i < estimates.size(); ++i)
    if (const auto& failure = estimates[i].failure;
        failure && (reasons.empty() || reasons.contains(failure->reason)))
      images[failure->reason].push_back(i);
  const auto most =
      std::ranges::max_element(images, {}, [](const auto& entry) { return entry.second.size(); });
  return most == images.end() ? std::vector<std::size_t>{} : most->second;
}

bool is_explained(const Failure& failure) {
  return std::ranges::any_of(
      std::array{"fitting_pixel_mm", "fitting_source_detector_mm", "fitting_diameters", "aspect"},
      [&](const char* key) { return failure.figures.contains(key); });
}

}  // namespace

Failure nothing_accepted(const std::vector<FrameEstimate>& estimates, const SweepCase& the_case,
                         unsigned threads) {
  const auto most = most_frequent(estimates);
  const std::size_t first = most.front();
  Failure failure = with_cause(*estimates[first].failure, the_case.frames[first], the_case, threads);
  failure.message = fmt::format("none of {} images is accepted; {} with this reason, the first: {}",
                                estimates.size(), most.size(), failure.message);
  failure.view.clear();
  failure.figures["images"] = double(estimates.size());
  return failure;
}

std::optional<Failure> unconfirmed(const std::vector<FrameEstimate>& estimates, std::size_t accepted,
                                   double noise_factor, const SweepCase& the_case, unsigned threads) {
  constexpr std::size_t least_confirmed = 8;  // frames of a path
  constexpr double doubtful_noise = 3;        // of accepted images that a wrong size may explain
  const std::set<Reason> unclear{Reason::ambiguous_labels, Reason::calibrator_mismatch};
  std::size_t refused = 0, unseen = 0;
  for (const FrameEstimate& at : estimates)
    if (at.failure) {
      refused += unclear.contains(at.failure->reason);
      unseen += at.failure->reason == Reason::too_few_fiducials;
    }
  if (refused + unseen <= accepted || (accepted >= least_confirmed && noise_factor < doubtful_noise))
    return std::nullopt;
  const std::size_t first =
      most_frequent(estimates, refused > 0 ? unclear : std::set{Reason::too_few_fiducials}).front();
  Failure failure = with_cause(*estimates[first].failure, the_case.frames[first], the_case, threads);
  if (!is_explained(failure) && (accepted >= least_confirmed || refused <= accepted)) return std::nullopt;
  failure.message = fmt::format(
      "only {} of {} images would be accepted, and the labels of {} are refused: too few "
      "to confirm each other; the first: {}",
      accepted, estimates.size(), refused + unseen, failure.message);
  failure.view.clear();
  failure.figures["accepted"] = double(accepted);
  failure.figures["refused"] = double(refused + unseen);
  failure.figures["images"] = double(estimates.size());
  return failure;
}

}  // namespace helicarm::sweep
