// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <set>
#include <vector>

#include "helicarm/fiducials/hypothesis.h"
#include "helicarm/fiducials/three_point.h"

namespace helicarm {

constexpr int least_balls = 6;  ///< that a labelling must name

/// The hypotheses met so far, best first and all different.
using Ranking = std::vector<Hypothesis>;

/// Where balls have a candidate within the rough gate (to a third of it), at the cost of one look each. Eight
/// balls go at a time, for the processor's sake.
class Neighbourhood {
 public:
  explicit Neighbourhood(const Scene& scene);

  /// Whether at least `wanted` balls do.
  bool holds(const View& view, int wanted) const;

 private:
  using Eight = Eigen::Array<float, 8, 1>;
  struct EightBalls {
    Eight x = Eight::Zero(), y = x, z = x;
    int used = 0;
  };
  std::vector<EightBalls> balls_;
  Eigen::Matrix3d cell_from_px_;
  float last_column_;
  float last_row_;
  std::vector<char> marked_;  ///< the outermost cells never are
};

/// Takes three candidates for every three balls in turn, mirrored and not, and settles each pose that others
/// of the candidates support.
class LabelSearch {
 public:
  /// `focals_px`: the focal lengths at which poses are tried. The scene must outlive the search.
  LabelSearch(const Scene& scene, std::vector<double> focals_px);

  /// False, and nothing done, when the three lie too nearly in a line or have been tried before.
  bool try_triple(std::array<int, 3> candidates);

  const Ranking& ranking() const { return ranking_; }
  const Scene& scene() const { return scene_; }

 private:
  void try_scale(const std::array<int, 3>& candidates, double focal_px);
  void try_pose(const View& rough, double lean);
  void keep(Hypothesis hypothesis);

  const Scene& scene_;
  std::vector<double> focals_px_;
  double flat_px_;  ///< least height of an image triangle
  std::vector<ModelTriangle> triangles_;
  Eigen::ArrayXf a_, b_, c_;   ///< of the triangles
  std::vector<Scale> scales_;  ///< candidate by ball
  Neighbourhood near_;
  std::set<std::array<int, 3>> triples_;  ///< tried
  std::set<std::vector<int>> tried_;      ///< matches of the poses settled
  Ranking ranking_;
};

/// Tries up to `triples` random triples of the candidates, until the best hypothesis will do after so many.
void explore(LabelSearch& search, std::size_t triples,
             const std::function<bool(const Hypothesis&, std::size_t tried)>& will_do);

/// Seeks rivals of the best hypothesis on triples of its own candidates, and of whichever unseats it. A rival
/// almost as good shares all but one or two of its candidates, so it holds several of these triples whole.
void challenge(LabelSearch& search);

}  // namespace helicarm
