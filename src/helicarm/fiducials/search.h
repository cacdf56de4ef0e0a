// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <set>
#include <vector>

#include "helicarm/fiducials/hypothesis.h"
#include "helicarm/fiducials/three_point.h"

namespace helicarm {

/// The hypotheses met so far, best first and all different.
using Ranking = std::vector<Hypothesis>;

/// Takes three candidates for every three balls in turn, mirrored and not, and settles each pose that others of the
/// candidates support.
class LabelSearch {
 public:
  /// `focals_px`: the focal lengths at which poses are tried. The scene must outlive the search.
  LabelSearch(const Scene& scene, std::vector<double> focals_px);

  /// False, and nothing done, when the three lie too nearly in a line.
  bool try_triple(const std::array<int, 3>& candidates);

  const Ranking& ranking() const { return ranking_; }

 private:
  void try_scale(const std::array<int, 3>& candidates, double focal_px);
  void try_pose(const View& rough, double lean);
  bool supported(const View& rough) const;
  void keep(Hypothesis hypothesis);

  const Scene& scene_;
  std::vector<double> focals_px_;
  double flat_px_;  ///< least height of an image triangle
  int support_;     ///< candidates asked for beyond the three
  std::vector<ModelTriangle> triangles_;
  std::vector<Scale> scales_;  ///< candidate by ball
  std::vector<float> u_;
  std::vector<float> v_;
  std::set<std::vector<int>> tried_;
  Ranking ranking_;
};

}  // namespace helicarm
