// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "helicarm/registration/model.h"
#include "helicarm/registration/observation.h"
#include "helicarm/registration/raster.h"

namespace helicarm::registration {

/// How the model is compared with the views: patches of a DRR, or the contour of a surface.
struct Level {
  bool contour = false;
  double spacing_mm = 1;  ///< of the rays in the model; contour: of the raster's pixels there
  double reach = 6;       ///< contour: as ContourOptions
  double sigma_px = 1;    ///< contour
};

/// Model and views prepared for comparisons at any level; rasters and densities are made once.
class RegistrationProblem {
 public:
  RegistrationProblem(const Model& model, const std::vector<RegistrationView>& views, unsigned threads);
  /// The same views for another model of the same kind.
  RegistrationProblem(const RegistrationProblem& other, const Model& model);

  const Model& model() const { return *model_; }
  const std::vector<RegistrationView>& views() const { return *views_; }
  unsigned threads() const { return threads_; }

  /// Makes what a level needs about this place (world): to be called before `observe`, which is const.
  void prepare(const Level& level, const Eigen::Vector3d& near);
  /// `which`: the views that are compared; empty: all. The others' observations are empty.
  Observation observe(const Level& level, const geometry::RigidTransform& pose, bool derivatives,
                      unsigned threads, const std::vector<bool>& which = {}) const;
  /// Spacing of the views' pixels at a place of the world, mm; the finest view's.
  double pixel_mm(const Eigen::Vector3d& at) const;
  /// Side of a view's patches, or spacing of its contour points, px; after `prepare`.
  double comparison_px(const Level& level, std::size_t view) const;
  /// What `prepare` made for a level.
  const Raster& raster(const Level& level, std::size_t view) const { return prepared(level).rasters[view]; }
  const Density& density(const Level& level) const { return prepared(level).density; }

 private:
  struct Prepared {
    std::vector<Raster> rasters;
    Density density;
  };
  const Prepared& prepared(const Level& level) const;

  const Model* model_;
  const std::vector<RegistrationView>* views_;
  unsigned threads_;
  std::vector<Raster> full_;
  std::map<std::pair<bool, double>, Prepared> levels_;  ///< by kind and spacing
};

/// Sums of a view's comparisons, the edge offset eliminated under its prior.
struct RigidEquations {
  RigidCovariance information = RigidCovariance::Zero();
  RigidStep gradient = RigidStep::Zero();
};

/// Standard deviation of the edge offset common to a view, px: bias of an edge against the surface.
inline constexpr double edge_offset_sigma_px = 1;

RigidEquations rigid_equations(const ViewObservation& view);

struct Estimate {
  geometry::RigidTransform pose;
  Observation observation;  ///< at the pose, with derivatives
  double score = 0;
};

struct RefineOptions {
  int iterations = 12;
  double converged = 0.002;                         ///< step, as a share of the level's spacing
  std::vector<bool> views = {};                     ///< that take part; empty: all
  RigidCovariance prior = RigidCovariance::Zero();  ///< information about the start
  unsigned threads = 1;
};

/// Gauss-Newton with damping (Levenberg-Marquardt) from a pose. A step is accepted if the score does not
/// fall.
Estimate refine(const RegistrationProblem& scene, const Level& level, const geometry::RigidTransform& start,
                const RefineOptions& options);

}  // namespace helicarm::registration
