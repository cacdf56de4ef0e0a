// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <set>
#include <vector>

#include "helicarm/fiducials/hypothesis.h"
#include "helicarm/fiducials/hypothesis_filter.h"

namespace helicarm::fiducials {

constexpr int least_balls = 6;  ///< least of a labelling

/// The hypotheses found so far, best first, all different.
using Ranking = std::vector<Hypothesis>;

/// Pose hypotheses from three candidates and every three balls, mirrored and not; those supported by further
/// candidates are matched and fitted.
class LabelSearch {
 public:
  /// `focals_px`: the focal lengths at which poses are tried. The scene must outlive the search.
  LabelSearch(const LabellingProblem& scene, std::vector<double> focals_px);

  /// False if the three are nearly collinear or have been tried.
  bool try_triple(std::array<int, 3> candidates);

  /// Matches and fits from the expected camera.
  void try_expected();

  /// Adds the variants of `h` in which a candidate near a ball, but outside its gate, is assigned to it: an
  /// outlier assigned to a hidden ball can shift the fit until a true candidate is outside.
  void try_near_misses(const Hypothesis& h);

  /// Fits the poses whose images are nearly those of `h` at a large distance: reversed in depth and mirrored,
  /// and reflected or turned about the principal axes (flat or symmetric calibrators).
  void try_symmetric_poses(const Hypothesis& h);

  const Ranking& ranking() const { return ranking_; }

  /// Up to `most` poses with candidates near at least `required` balls, by decreasing number.
  std::vector<geometry::View> supported(int required, std::size_t most) const;
  const LabellingProblem& scene() const { return scene_; }

 private:
  struct Rough {
    int matched;
    geometry::View view;
  };

  void try_scale(const std::array<int, 3>& candidates, double focal_px);
  int required() const;  ///< balls near candidates
  void try_pose(const geometry::View& rough, double depth_sign);
  void keep(Hypothesis hypothesis);

  const LabellingProblem& scene_;
  std::vector<double> focals_px_;
  double flat_px_;                  ///< least height of an image triangle
  Eigen::Matrix3d principal_axes_;  ///< of the balls, columns
  HypothesisFilter filter_;
  std::set<std::array<int, 3>> triples_;  ///< tried
  std::set<std::vector<int>> tried_;      ///< matches of the fitted poses
  std::vector<Rough> supported_;
  Ranking ranking_;
};

/// Number of random triples after which none is of three true balls, of `balls` among the candidates, with a
/// probability below 1e-3.
std::size_t triples_required(int balls, std::size_t candidates);

/// Tries up to `triples` random triples of the candidates, until the best hypothesis is sufficient.
void try_random_triples(LabelSearch& search, std::size_t triples,
                        const std::function<bool(const Hypothesis&, std::size_t tried)>& is_sufficient);

/// Searches for rivals of the best hypothesis on triples of its candidates, and again whenever the best
/// changes. A rival almost as good shares all but one or two candidates, hence several triples.
void search_rivals(LabelSearch& search);

}  // namespace helicarm::fiducials
