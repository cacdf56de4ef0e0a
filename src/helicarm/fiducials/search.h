// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <set>
#include <vector>

#include "helicarm/fiducials/hypothesis.h"
#include "helicarm/fiducials/hypothesis_filter.h"

namespace helicarm {

constexpr int least_balls = 6;  ///< that a labelling must name

/// The hypotheses met so far, best first and all different.
using Ranking = std::vector<Hypothesis>;

/// Takes three candidates for every three balls in turn, mirrored and not, and settles each pose that others
/// of the candidates support.
class LabelSearch {
 public:
  /// `focals_px`: the focal lengths at which poses are tried. The scene must outlive the search.
  LabelSearch(const Scene& scene, std::vector<double> focals_px);

  /// False, and nothing done, when the three lie too nearly in a line or have been tried before.
  bool try_triple(std::array<int, 3> candidates);

  /// Weighs what becomes of `h` when a candidate near a ball, but not near enough for it, is that ball after
  /// all. A false disc in a hidden ball's stead can bend the fit until a true one is missed.
  void try_near_misses(const Hypothesis& h);

  /// Settles the poses that show nearly the same as `h` from afar, whatever the calibrator: turned back to
  /// front in a mirrored image, and mirrored or turned about its principal axes, which keep a flat or
  /// symmetric calibrator's balls about where they are.
  void try_twins(const Hypothesis& h);

  const Ranking& ranking() const { return ranking_; }

  /// The poses met that have candidates near at least `wanted` balls, best supported first, up to `most`.
  std::vector<View> supported(int wanted, std::size_t most) const;
  const Scene& scene() const { return scene_; }

 private:
  struct Rough {
    int matched;
    View view;
  };

  void try_scale(const std::array<int, 3>& candidates, double focal_px);
  int wanted() const;  ///< balls near candidates
  void try_pose(const View& rough, double lean);
  void keep(Hypothesis hypothesis);

  const Scene& scene_;
  std::vector<double> focals_px_;
  double flat_px_;                  ///< least height of an image triangle
  Eigen::Matrix3d principal_axes_;  ///< of the balls, columns
  HypothesisFilter filter_;
  std::set<std::array<int, 3>> triples_;  ///< tried
  std::set<std::vector<int>> tried_;      ///< matches of the poses settled
  std::vector<Rough> met_;
  Ranking ranking_;
};

/// So many random triples that `balls` balls among the candidates escape with a chance below 1e-3.
std::size_t triples_to_meet(int balls, std::size_t candidates);

/// Tries up to `triples` random triples of the candidates, until the best hypothesis will do after so many.
void explore(LabelSearch& search, std::size_t triples,
             const std::function<bool(const Hypothesis&, std::size_t tried)>& will_do);

/// Seeks rivals of the best hypothesis on triples of its own candidates, and of whichever unseats it. A rival
/// almost as good shares all but one or two of its candidates, so it holds several of these triples whole.
void challenge(LabelSearch& search);

}  // namespace helicarm
