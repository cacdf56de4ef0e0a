// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <set>
#include <vector>

#include "helicarm/fiducials/hypothesis.h"
#include "helicarm/fiducials/three_point.h"

namespace helicarm {

/// The hypotheses met so far, best first and all different.
using Ranking = std::vector<Hypothesis>;

/// Whether a pixel has a candidate within the rough gate (to a third of it), at the cost of one look.
class Neighbourhood {
 public:
  explicit Neighbourhood(const Scene& scene);
  bool holds(float u, float v) const {
    const float x = (u - left_) * cells_per_px_;
    const float y = (v - top_) * cells_per_px_;
    if (!(x >= 0 && y >= 0 && x < static_cast<float>(columns_) && y < static_cast<float>(rows_)))
      return false;
    return marked_[static_cast<std::size_t>(y) * columns_ + static_cast<std::size_t>(x)] != 0;
  }

 private:
  float left_;
  float top_;
  float cells_per_px_;
  int columns_;
  int rows_;
  std::vector<char> marked_;
};

/// Takes three candidates for every three balls in turn, mirrored and not, and settles each pose that others
/// of the candidates support.
class LabelSearch {
 public:
  /// `focals_px`: the focal lengths at which poses are tried. The scene must outlive the search.
  LabelSearch(const Scene& scene, std::vector<double> focals_px);

  /// False, and nothing done, when the three lie too nearly in a line.
  bool try_triple(const std::array<int, 3>& candidates);

  const Ranking& ranking() const { return ranking_; }
  const Scene& scene() const { return scene_; }

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
  Neighbourhood near_;
  std::vector<Eigen::Vector4f> centres_;  ///< of the balls, homogeneous
  std::set<std::vector<int>> tried_;
  Ranking ranking_;
};

/// Tries up to `triples` random triples of the candidates, until the best hypothesis will do.
void explore(LabelSearch& search, std::size_t triples, const std::function<bool(const Hypothesis&)>& will_do);

/// Seeks rivals of the best hypothesis on triples of its own candidates, and of whichever unseats it. A rival
/// almost as good shares all but one or two of its candidates, so it holds several of these triples whole.
void challenge(LabelSearch& search);

}  // namespace helicarm
