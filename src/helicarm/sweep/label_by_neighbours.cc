// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/label_by_neighbours.h"

#include <algorithm>
#include <atomic>
#include <optional>
#include <utility>

#include "helicarm/core/parallel.h"

namespace helicarm::sweep {
namespace {

/// The camera on the way between two others, or beyond them, by the share of the way; nothing where the run
/// turns by too much between them.
std::optional<fiducials::ExpectedView> camera_between(const geometry::View& before,
                                                      const geometry::View& after, double share) {
  constexpr double most_deg = 15, least_within_deg = 2, of_the_way = 0.5;
  const Eigen::Quaterniond first(before.camera_from_world.rotation), last(after.camera_from_world.rotation);
  const double turned_deg = first.angularDistance(last) * 180 / EIGEN_PI;
  if (turned_deg > most_deg) return {};
  const auto mean = [&](const auto& a, const auto& b) { return ((1 - share) * a + share * b).eval(); };
  geometry::View view = before;
  view.camera_from_world.rotation = first.slerp(share, last).toRotationMatrix();
  view.camera_from_world.translation =
      -view.camera_from_world.rotation * mean(before.source_in_world(), after.source_in_world());
  const geometry::Intrinsics &k = before.intrinsics, &l = after.intrinsics;
  const Eigen::Vector4d inner =
      mean(Eigen::Vector4d(k.fx, k.fy, k.u0, k.v0), Eigen::Vector4d(l.fx, l.fy, l.u0, l.v0));
  view.intrinsics = {inner[0], inner[1], inner[2], inner[3]};
  return fiducials::ExpectedView{view,
                                 std::max(least_within_deg, of_the_way * turned_deg * std::max(1.0, share))};
}

/// Pairs of accepted frames from which the camera of a frame follows: those on both sides, then the two
/// nearest ones on either side; each at most `reach` away.
std::vector<std::pair<std::ptrdiff_t, std::ptrdiff_t>> neighbours_of(
    std::ptrdiff_t frame, const std::vector<FrameEstimate>& frames) {
  constexpr std::ptrdiff_t reach = 5;
  const auto next = [&](std::ptrdiff_t from, std::ptrdiff_t step) -> std::optional<std::ptrdiff_t> {
    for (std::ptrdiff_t i = from + step; std::abs(i - frame) <= reach; i += step)
      if (i >= 0 && i < std::ssize(frames) && !frames[std::size_t(i)].failure) return i;
    return {};
  };
  std::vector<std::pair<std::ptrdiff_t, std::ptrdiff_t>> pairs;
  const auto before = next(frame, -1), after = next(frame, 1);
  if (before && after) pairs.emplace_back(*before, *after);
  for (const auto& [nearest, step] : {std::pair(before, -1), std::pair(after, 1)})
    if (nearest)
      if (const auto farther = next(*nearest, step)) pairs.emplace_back(*farther, *nearest);
  return pairs;
}

/// The camera of a frame by the accepted frames beside it, if they tell.
std::optional<fiducials::ExpectedView> expected_at(std::ptrdiff_t frame,
                                                   const std::vector<FrameEstimate>& frames) {
  for (const auto& [first, second] : neighbours_of(frame, frames))
    if (auto expected =
            camera_between(frames[std::size_t(first)].alone->view, frames[std::size_t(second)].alone->view,
                           double(frame - first) / double(second - first)))
      return expected;
  return {};
}

}  // namespace

int label_by_neighbours(double noise_factor, const SweepCase& the_case, std::vector<FrameEstimate>& estimates,
                        unsigned threads) {
  const std::vector<FrameEstimate> alone = estimates;
  pipeline::RunOptions run;
  run.maps = the_case.maps;
  std::atomic<int> labelled = 0;
  parallel_for(estimates.size(), threads, [&](std::size_t index) {
    if (!alone[index].failure || alone[index].failure->reason != Reason::ambiguous_labels) return;
    const auto expected = expected_at(std::ptrdiff_t(index), alone);
    if (!expected) return;
    const Frame& frame = the_case.frames[index];
    auto again = estimate_frame(frame, file_of(frame, the_case), the_case.base, run, expected);
    if (!again || again->failure) return;
    calibrate_with(noise_factor, the_case.base, *again, frame.view.name);
    if (again->failure) return;
    estimates[index] = *std::move(again);
    ++labelled;
  });
  return labelled;
}

}  // namespace helicarm::sweep
