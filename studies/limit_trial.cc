// SPDX-License-Identifier: Apache-2.0
#include "studies/limit_trial.h"

#include <cmath>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "helicarm/calibration/c_arm_history.h"
#include "helicarm/calibration/calibrate.h"
#include "helicarm/core/random_vectors.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/small_matrix.h"
#include "helicarm/localization/locate.h"
#include "helicarm/phantom/conical_helix.h"
#include "helicarm/pipeline/prior.h"
#include "studies/cramer_rao.h"
#include "studies/records.h"

namespace helicarm::study {
namespace {

using Eigen::Vector3d;

constexpr double px_per_mm = 1 / 0.15;
constexpr double focal_mm = 900;
constexpr double middle_px = 511.5;
constexpr double exact_px = 1e-3;              // noise of an exact pixel
constexpr double chi2_95 = 7.814727903251179;  // 3 degrees of freedom
constexpr double pinned = 1e-6;                // sigma of a known parameter
constexpr double known_mm = 1e-3;              // as above, for a length
constexpr double aspect_sigma = 1e-3;
constexpr std::size_t bound_trials = 200;  // if each trial has its own bound
constexpr int entries_of_history = 12;

const Vector3d centre(0, 0, 40);  // of the places

/// The experiment's C-arms: an unknown one of its make, and one with small sag.
const calibration::CArmPrior make = pipeline::unknown_c_arm();
const calibration::CArmPrior stiff{calibration::IntrinsicsVariation{10, 0.3},
                                   calibration::IntrinsicsVariation{7, 0.5}};

std::vector<Vector3d> balls_on_helix(int n) {
  std::vector<Vector3d> balls;
  for (int k = 0; k < n; ++k)
    balls.push_back(phantom::ConicalHelix().point(std::numbers::pi * (1.0 / 6 + 5.5 * k / (n - 1))));
  return balls;
}

/// Deviations of focal length and principal point from nominal, mm.
Vector3d variation(const calibration::CArmPrior& c_arm, double calibration::IntrinsicsVariation::*part,
                   RandomStream& random) {
  return {*c_arm.focal.*part * random.normal(), *c_arm.principal.*part * random.normal(),
          *c_arm.principal.*part * random.normal()};
}

geometry::View view_with(const Vector3d& variation_mm, double aspect, double angle) {
  const double f = px_per_mm * (focal_mm + variation_mm.x());
  const Eigen::Matrix3d rotation = geometry::rotation_from_euler(angle, 0, 0);
  return {{2 * f * aspect / (1 + aspect), 2 * f / (1 + aspect), middle_px + px_per_mm * variation_mm.y(),
           middle_px + px_per_mm * variation_mm.z(), 0},
          {rotation, Vector3d(0, 0, 800) - rotation * centre}};
}

std::array<geometry::View, 2> views_of(const calibration::CArmPrior& c_arm, const Vector3d& common_mm,
                                       double aspect_spread, RandomStream& random) {
  std::array<geometry::View, 2> views;
  for (std::size_t i = 0; i < 2; ++i) {
    const double aspect = 1 + aspect_spread * random.normal();
    views[i] = view_with(common_mm + variation(c_arm, &calibration::IntrinsicsVariation::of_view, random),
                         aspect, double(i) * std::numbers::pi / 2);
  }
  return views;
}

calibration::ViewFiducials pictured(const char* name, const geometry::View& view,
                                    const std::vector<Vector3d>& balls, double sigma, RandomStream& random) {
  calibration::ViewFiducials seen{name, {}};
  for (const Vector3d& ball : balls) {
    fiducials::Fiducial fiducial{fmt::format("P{}", seen.fiducials.size() + 1), ball};
    fiducial.status = fiducials::FiducialStatus::used;
    fiducial.sigma_px = sigma;
    fiducial.uv = view.project(ball) + sigma * normal_2(random);
    seen.fiducials.push_back(fiducial);
  }
  seen.prior = {px_per_mm * focal_mm, Eigen::Vector2d(middle_px, middle_px), px_per_mm};
  return seen;
}

/// A C-arm and its history of earlier acquisitions.
struct KnownCArm {
  Vector3d mean_variation_mm;
  calibration::LearnedIntrinsics knowledge;
};

KnownCArm c_arm_with_history(const LimitSetting& setting, const std::vector<Vector3d>& balls,
                             RandomStream random) {
  KnownCArm known;
  known.mean_variation_mm = variation(stiff, &calibration::IntrinsicsVariation::common, random);
  std::vector<calibration::HistoryEntry> true_views;
  while (int(true_views.size()) < entries_of_history)
    for (const geometry::View& view : views_of(stiff, known.mean_variation_mm, aspect_sigma, random)) {
      calibration::ViewFiducials seen = pictured("", view, balls, setting.sigma_px, random);
      seen.prior.aspect = geometry::NormalPrior{1, aspect_sigma};
      if (const auto true_view = calibration::history_entry_of(seen, "", {make}))
        true_views.push_back(*true_view);
    }
  known.knowledge = calibration::learn_intrinsics(true_views, {focal_mm, 0, 0}, make);
  return known;
}

/// The priors given to the estimator and to the bound.
struct PriorKnowledge {
  calibration::CArmPrior c_arm;
  std::optional<geometry::NormalPrior> aspect;
  std::optional<geometry::NormalPrior> skew = geometry::NormalPrior{0, pinned};
  PriorInformation bound;
};

PriorKnowledge told_of(LimitModel model) {
  const auto variations = [](const calibration::IntrinsicsVariation& d) {
    return Eigen::MatrixXd(px_per_mm * px_per_mm *
                           (Eigen::Matrix2d::Constant(d.common * d.common) +
                            Eigen::Matrix2d(d.of_view * d.of_view * Eigen::Matrix2d::Identity())));
  };
  const auto with = [&](const calibration::CArmPrior& c_arm, double aspect) {
    return PriorKnowledge{c_arm,
                          geometry::NormalPrior{1, aspect},
                          geometry::NormalPrior{0, pinned},
                          {variations(*c_arm.focal), variations(*c_arm.principal), aspect, pinned}};
  };
  switch (model) {
    case LimitModel::free:
      return {{}, {}, {}, {}};
    case LimitModel::square:
      return {
          {}, geometry::NormalPrior{1, pinned}, geometry::NormalPrior{0, pinned}, {{}, {}, pinned, pinned}};
    case LimitModel::prior:
      return with(make, aspect_sigma);
    case LimitModel::c_arm:  // bound for a C-arm with known mean and sag
      return with({calibration::IntrinsicsVariation{known_mm, stiff.focal->of_view},
                   calibration::IntrinsicsVariation{known_mm, stiff.principal->of_view}},
                  aspect_sigma);
    case LimitModel::known:
      return with({calibration::IntrinsicsVariation{known_mm, known_mm},
                   calibration::IntrinsicsVariation{known_mm, known_mm}},
                  pinned);
  }
  return {};
}

std::optional<localization::LocatedPoint> located(
    const std::array<Eigen::Vector2d, 2>& pixels, double sigma,
    const Expected<calibration::CalibrationResult>& calibration) {
  if (!calibration) return std::nullopt;
  std::vector<localization::PointObservation> images;
  for (std::size_t i = 0; i < 2; ++i)
    images.push_back({i, pixels[i], sigma * sigma * Eigen::Matrix2d::Identity()});
  const auto point = localization::locate("", localization::PointSource::target, images, *calibration);
  return point ? std::optional(*point) : std::nullopt;
}

LimitOutcomes try_once(const LimitSetting& setting, const std::vector<Vector3d>& balls,
                       const KnownCArm* c_arm, std::uint64_t seed, std::size_t trial) {
  RandomStream random(seed, setting.stream, trial);
  const PriorKnowledge prior_knowledge = told_of(setting.model);
  const bool drawn = setting.model == LimitModel::prior || setting.model == LimitModel::c_arm;
  const calibration::CArmPrior& arm = c_arm ? stiff : make;
  const Vector3d common = c_arm ? c_arm->mean_variation_mm
                          : setting.model == LimitModel::prior
                              ? variation(arm, &calibration::IntrinsicsVariation::common, random)
                              : Vector3d::Zero();
  const std::array<geometry::View, 2> views =
      drawn ? views_of(arm, common, aspect_sigma, random)
            : std::array{view_with(Vector3d::Zero(), 1, 0),
                         view_with(Vector3d::Zero(), 1, std::numbers::pi / 2)};
  std::vector<calibration::ViewFiducials> seen;
  for (std::size_t i = 0; i < 2; ++i) {
    seen.push_back(pictured(i == 0 ? "AP" : "LAT", views[i], balls, setting.sigma_px, random));
    seen[i].prior.aspect = prior_knowledge.aspect;
    seen[i].prior.skew = prior_knowledge.skew;
    if (c_arm)
      seen[i].prior = calibration::learned_prior(seen[i].prior, c_arm->knowledge.deviation.mm, false);
  }
  calibration::CalibrationOptions options;
  options.common.c_arm = c_arm ? c_arm->knowledge.deviation.prior : prior_knowledge.c_arm;
  const auto calibration = calibration::calibrate(seen, options);
  const auto dlt = calibration::calibrate_paper(seen, options);

  LimitOutcomes outcomes;
  for (std::size_t k = 0; k < rows_of_limit_setting; ++k) {
    const Vector3d truth = centre + limit_places[k / 2].off_centre_mm;
    const double sigma = k % 2 ? exact_px : setting.sigma_px;
    std::array<Eigen::Vector2d, 2> pixels;
    for (std::size_t i = 0; i < 2; ++i) pixels[i] = views[i].project(truth) + sigma * normal_2(random);
    LimitOutcome& outcome = outcomes[k];
    if (const auto point = located(pixels, sigma, calibration)) {
      const Vector3d error = point->point_in_anchor - truth;
      outcome.located = 1;
      outcome.error2 = error.squaredNorm();
      outcome.covered = geometry::squared_distance(error, point->covariance_in_anchor) < chi2_95;
    }
    if (const auto point = located(pixels, sigma, dlt))
      outcome.dlt2 = (point->point_in_anchor - truth).squaredNorm();
    if (trial == 0 || (drawn && trial < bound_trials))
      outcome.bound2 =
          least_covariance(views, balls, truth, setting.sigma_px, sigma, prior_knowledge.bound).trace();
  }
  return outcomes;
}

}  // namespace

void run_limit_trials(const LimitSetting& setting, const LimitOptions& options, std::size_t block,
                      std::span<double> out) {
  const std::vector<Vector3d> balls = balls_on_helix(setting.balls);
  std::optional<KnownCArm> c_arm;
  if (setting.model == LimitModel::c_arm)
    c_arm = c_arm_with_history(setting, balls, RandomStream(options.seed, setting.stream + 1000, block));
  const std::size_t end = std::min(options.groups, (block + 1) * limit_trials_of_block);
  for (std::size_t trial = block * limit_trials_of_block; trial < end; ++trial)
    put_record(try_once(setting, balls, c_arm ? &*c_arm : nullptr, options.seed, trial), out);
}

}  // namespace helicarm::study
