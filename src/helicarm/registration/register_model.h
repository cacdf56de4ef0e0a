// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/registration/estimate.h"
#include "helicarm/registration/starts.h"

namespace helicarm::registration {

enum class Decision { accept, warn, refuse };
inline constexpr std::array<std::string_view, 3> decision_words{"accept", "warn", "refuse"};
inline std::string_view word(Decision decision) { return decision_words[std::size_t(decision)]; }

/// Of a model's size where the case states none: a CT's field of view and table, resampling, a threshold.
inline constexpr double usual_scale_sigma = 0.005;

struct RegistrationOptions {
  SearchOptions search = {};
  std::optional<double> max_error_mm;      ///< refuse (uncertain) if a point's 95 % error exceeds it
  double scale_sigma = usual_scale_sigma;  ///< relative, of the model's size
  unsigned threads = 0;                    ///< 0: all cores
  /// Of all views' parameters, 11 n x 11 n; empty: the views' own covariances, taken as independent.
  Eigen::MatrixXd camera_covariance = {};
  /// Motion of the model between the first view's acquisition and each later one, per axis, mm.
  double motion_sigma_mm = 0;
  bool names_causes = true;  ///< of a refusal, and of a part alone (causes.h): takes seconds
  /// Called with the name of each step. An exception ends the registration.
  std::function<void(std::string_view step)> on_step = {};
};

/// Agreement of the image with a patch, or with a point of a surface's contour.
struct LocalAgreement {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< its middle
  double agreement = 0;                             ///< 1: as predicted; 0: unrelated; negative: reversed
  double weight = 0;                                ///< in the view's score
};

struct RegisteredView {
  std::string name;
  double score = 0;                   ///< agreement with the image, at most 1
  double residual_px = 0;             ///< rms of the shifts that parts of the image still ask for
  std::optional<double> held_out_mm;  ///< between this view and the others, along what both can see
  int comparisons = 0;                ///< patches or contour points

  std::vector<LocalAgreement> agreements = {};  ///< of the finest comparison
  double comparison_px = 0;                     ///< side of a patch, or spacing of the contour points
};

struct RunnerUp {
  double distance_mm = 0;  ///< rms over the model
  double cost_ratio = 0;   ///< (1 - its score) / (1 - the best's): 1 is as good
};

/// A relative change of the model's size that would fit better.
struct Deformation {
  double strain = 0;  ///< largest principal value
  double sigma = 0;
};

/// What the views, each alone, say of each other.
struct Disagreement {
  double chi2 = 0;  ///< of the differences between the views' own solutions
  int dof = 0;
  double distance_mm = 0;           ///< largest of `held_out_mm`
  double sigma_mm = 0;              ///< of that one
  std::vector<double> held_out_mm;  ///< per view

  /// By which the covariance is inflated (Birge 1932), at least 1.
  double ratio() const { return dof > 0 && chi2 > dof ? chi2 / dof : 1; }
};

/// A part of a model that its pose does not explain: pose and covariance do not hold for points there.
struct NotExplained {
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< of the plane before it; model coordinates
  Eigen::Vector3d towards = Eigen::Vector3d::UnitX();

  /// As comparisons have no depth, the plane is known to about this.
  static constexpr double margin_mm = 12;
  /// Whether a ball about a point may reach the part.
  bool may_have(const Eigen::Vector3d& in_model, double radius_mm = 0) const {
    return !(towards.dot(in_model - at) < -(margin_mm + radius_mm));
  }
};

/// Pose of a model in the views' world with what is known of its error.
struct Registration {
  std::string name;
  Decision decision = Decision::refuse;
  std::optional<Failure> failure;
  std::vector<Warning> warnings;
  std::vector<Warning> notes;
  geometry::RigidTransform world_from_model;
  /// About `centre`, as RigidStep, with the error of the model's size; not a number where the images do not
  /// determine the pose (refused).
  RigidCovariance covariance = RigidCovariance::Constant(std::numeric_limits<double>::quiet_NaN());
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< world
  double scale_sigma = 0;                            ///< relative, of the model's size
  RigidStep by_scale = RigidStep::Zero();  ///< error of the pose for a body larger than its model by that
  double score = 0;
  double spacing_mm = 0;  ///< of the finest comparison
  int starts = 0, agree = 0;
  std::optional<RunnerUp> runner_up;
  std::vector<Alternative> alternatives = {};  ///< at most two other poses, of the finest levels first
  bool anywhere = false;                       ///< found by a search over every orientation and position
  /// Cost ratio of the mirrored model. None: a search without candidates, or a surface that is its own mirror
  /// image.
  std::optional<double> mirrored_ratio;
  std::optional<NotExplained> not_explained = {};  ///< of one that is not refused; with a warning
  Deformation deformation;
  std::optional<Disagreement> disagreement;  ///< of two or more views
  std::vector<RegisteredView> views;
  double seconds = 0;

  bool is_determined() const { return covariance.allFinite(); }
};

/// A larger 95 % error is warned of (uncertain) if no limit is given.
inline constexpr double usual_error_mm = 2;

/// covariance_missing, of a registration to cameras of other programs.
Warning cameras_without_covariance(const std::string& name);

/// Registers a model to the views from starting poses (world_from_model). Without one, which needs two views,
/// and after a refusal in two views, every orientation and position is searched. Refusals are in the result:
/// out_of_capture, wrong_model, registration_ambiguous, registration_disagrees, uncertain.
Registration register_model(const Model& model, const std::vector<RegistrationView>& views,
                            const std::vector<geometry::RigidTransform>& starts,
                            const RegistrationOptions& options);

/// Covariance (mm^2) of a point of the body at a place of the world: of the pose and of the body's size.
/// `by_scale`: of the pose's error, as in `Registration`.
Eigen::Matrix3d point_covariance(const RigidCovariance& covariance, const RigidStep& by_scale,
                                 double scale_sigma, const Eigen::Vector3d& centre,
                                 const Eigen::Vector3d& in_world);
Eigen::Matrix3d point_covariance(const Registration& registration, const Eigen::Vector3d& in_world);

/// 95 % length of the error of the worst of the model's samples, mm.
double worst_error_mm(const Model& model, const Registration& registration);

}  // namespace helicarm::registration
