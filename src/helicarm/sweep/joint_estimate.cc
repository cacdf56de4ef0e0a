// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/joint_estimate.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "helicarm/calibration/view_problem.h"
#include "helicarm/core/statistics.h"
#include "helicarm/fiducials/centre_error.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/dlt.h"
#include "helicarm/pipeline/prior.h"
#include "helicarm/sweep/run_noise.h"
#include "helicarm/sweep/shared_errors.h"

namespace helicarm::sweep {
namespace {

// By chance one run in 1000 (chi2 of 6 degrees of freedom at some 20 independent places); runs without a
// motion reach 8 to 12, those moved by 0.6 mm at 2 mm of flex 50 to 70.
constexpr double step_chi2 = 32;
constexpr double off_path_limit = 5.5;  // standard deviations
constexpr std::size_t least_path = 8;   // frames
constexpr int relinearisations = 4;

void whiten(FramePoints& points, const Eigen::VectorXd& of_centres_px2) {
  Eigen::MatrixXd covariance_px2 = points.map_covariance_px2;
  covariance_px2.diagonal() += of_centres_px2 + points.ball_variance_px2;
  points.whitening = geometry::whitening(covariance_px2).value();
}

FramePoints points_of(const FrameEstimate& estimate, const std::vector<Eigen::Matrix3Xd>& errors,
                      double noise_factor) {
  FramePoints points;
  const auto& balls = estimate.fiducials.fiducials;
  std::vector<double> of_centres, of_balls;
  for (std::size_t k = 0; k < balls.size(); ++k) {
    if (balls[k].status != fiducials::FiducialStatus::used) continue;
    points.points.push_back(balls[k].centre_in_calibrator);
    points.pixels.push_back(balls[k].uv);
    points.balls.push_back(k);
    of_centres.push_back(balls[k].sigma_px * balls[k].sigma_px);
    // Weighted as if the ball's own error were independent; what it shares is added to the covariance.
    const double px_per_mm = std::abs(estimate.alone->view.intrinsics.fy) /
                             estimate.alone->view.depth(balls[k].centre_in_calibrator);
    const Eigen::Index own = errors[k].cols() - 1;
    of_balls.push_back(errors[k].leftCols(own).squaredNorm() / 3 * px_per_mm * px_per_mm);
  }
  const auto n = std::ssize(points.points);
  const Eigen::MatrixXd& of_map = estimate.fiducials.map_covariance_px2;
  points.map_covariance_px2 = of_map.size() > 0 ? of_map : Eigen::MatrixXd::Zero(n, n);
  points.ball_variance_px2 = Eigen::Map<const Eigen::VectorXd>(of_balls.data(), n);
  // The variance of a fiducial is that of the image, a floor, and the map's, all times the factor.
  constexpr double least_px2 = 1e-6;
  const double floor_px2 = std::pow(noise_factor * fiducials::sigma_floor_px, 2);
  const Eigen::VectorXd without_map =
      (Eigen::Map<const Eigen::VectorXd>(of_centres.data(), n) - points.map_covariance_px2.diagonal())
          .cwiseMax(floor_px2);
  points.image_variance_px2 =
      (without_map.array() - floor_px2).max(least_px2).matrix() / (noise_factor * noise_factor);
  whiten(points, without_map);
  return points;
}

/// Nominal distance and principal point, of the path as a whole.
PathPrior prior_of(const Orbit& orbit, std::optional<double> source_detector_mm) {
  const calibration::CArmPrior c_arm = pipeline::unknown_c_arm();
  const Eigen::Vector3d towards = orbit.first.rotation * (orbit.first.detector - orbit.first.source);
  PathPrior prior;
  for (Eigen::Index k = 0; k < 3; ++k) {
    if (k == 2 && !source_detector_mm) continue;
    const calibration::IntrinsicsVariation& variation = k == 2 ? *c_arm.focal : *c_arm.principal;
    const double weight = 1 / (variation.common * variation.common + variation.of_view * variation.of_view);
    CameraVector row = CameraVector::Zero();
    row[k] = -1;
    row[3 + k] = 1;
    prior.information += weight * row * row.transpose();
    prior.gradient += weight * ((k == 2 ? *source_detector_mm : 0) - towards[k]) * row;
  }
  return prior;
}

/// The joint estimate of the accepted frames.
struct Joint {
  OrbitFit fit;
  std::vector<std::size_t> frames;  ///< index in the run, by the angle along the path
  std::vector<FramePoints> points;
  std::vector<PlacedCamera> at;
  std::vector<PathObservation> observations;
  PathPrior prior;
  SmoothPath smooth;
  std::vector<double> angles_deg;
};

/// Weights the fiducials by the noise that their residuals about the joint cameras show.
void weigh(Joint& joint, const Detector& detector) {
  std::vector<std::vector<NoiseSample>> samples(joint.points.size());
  for (std::size_t i = 0; i < joint.points.size(); ++i) {
    const FramePoints& frame = joint.points[i];
    const geometry::View view = view_of(joint.at[i], detector);
    const std::vector<double> shares =
        free_shares(frame, joint.at[i], joint.smooth.points[i].camera_covariance,
                    joint.fit.orbit.at(joint.angles_deg[i]), detector);
    for (std::size_t k = 0; k < frame.points.size(); ++k) {
      const auto row = Eigen::Index(k);
      samples[i].push_back({frame.balls[k], frame.pixels[k] - view.project(frame.points[k]),
                            frame.image_variance_px2[row],
                            frame.map_covariance_px2(row, row) + frame.ball_variance_px2[row], shares[k]});
    }
  }
  const RunNoise noise = noise_of(samples);
  for (std::size_t i = 0; i < joint.points.size(); ++i) {
    const std::vector<double>& variances = noise.variance_px2[i];
    whiten(joint.points[i], Eigen::Map<const Eigen::VectorXd>(variances.data(), std::ssize(variances)));
  }
}

Joint joint_of(const std::vector<FrameEstimate>& estimates, const std::vector<std::size_t>& accepted,
               const Detector& detector, const phantom::Calibrator& calibrator,
               const std::vector<Eigen::Matrix3Xd>& errors, std::optional<double> source_detector_mm,
               double noise_factor) {
  std::vector<PlacedCamera> alone;
  for (const std::size_t i : accepted) alone.push_back(placed(estimates[i].alone->view, detector));
  Joint joint;
  joint.fit = fit_orbit(alone, phantom::middle_of(calibrator));
  std::vector<std::size_t> by_angle(accepted.size());
  std::iota(by_angle.begin(), by_angle.end(), std::size_t(0));
  std::ranges::stable_sort(by_angle, {}, [&](std::size_t i) { return joint.fit.angles_deg[i]; });
  for (const std::size_t i : by_angle) {
    joint.frames.push_back(accepted[i]);
    joint.angles_deg.push_back(joint.fit.angles_deg[i]);
    joint.points.push_back(points_of(estimates[accepted[i]], errors, noise_factor));
    joint.at.push_back(alone[i]);
  }
  joint.prior = prior_of(joint.fit.orbit, source_detector_mm);
  // Of stiffness and noise: they do not change once the frames are near the path, and weights from weights
  // would shrink the noise by what they leave out.
  constexpr int choices = 2;
  for (int round = 0; round < relinearisations; ++round) {
    if (round > 0 && round < choices) weigh(joint, detector);
    joint.observations.clear();
    for (std::size_t i = 0; i < joint.at.size(); ++i)
      joint.observations.push_back(
          observation_of(joint.points[i], joint.at[i], joint.angles_deg[i], joint.fit.orbit, detector));
    const Stiffness stiffness =
        round == 0        ? choose_stiffness(joint.observations, joint.prior)
        : round < choices ? choose_stiffness(joint.observations, joint.prior, joint.smooth.stiffness)
                          : joint.smooth.stiffness;
    joint.smooth = smooth_path(joint.observations, joint.prior, stiffness);
    for (std::size_t i = 0; i < joint.at.size(); ++i)
      joint.at[i] = deviated(joint.fit.orbit.at(joint.angles_deg[i]), joint.smooth.points[i].camera);
  }
  return joint;
}

int path_dof(const Joint& joint) { return joint.fit.orbit.axis ? camera_size - 1 : camera_size; }

void refuse_frame(SweepFrame& frame, Reason reason, std::string message,
                  std::map<std::string, double> figures) {
  frame.failure = Failure{reason, std::move(message), frame.view, std::move(figures)};
  frame.decision = Decision::refuse;
  frame.best.reset();
}

/// Refuses the frames from a motion of the phantom on; false if there is none.
bool refuse_moved(Sweep& sweep, const Joint& joint) {
  std::vector<std::size_t> order(joint.frames.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::ranges::sort(order, {}, [&](std::size_t i) { return joint.frames[i]; });
  const auto step = find_step(joint.observations, joint.prior, joint.smooth.stiffness, order);
  if (!step || step->chi2 < step_chi2) return false;
  const SweepFrame& first = sweep.frames[joint.frames[order[step->first]]];
  const int number = first.number;
  const double moved_mm = step->motion.tail<3>().norm(),
               turned_deg = step->motion.head<3>().norm() * 180 / EIGEN_PI;
  for (std::size_t k = step->first; k < order.size(); ++k)
    refuse_frame(
        sweep.frames[joint.frames[order[k]]], Reason::phantom_changed,
        fmt::format("from image {} on, source and detector are displaced together by {:.2f} mm and {:.2f} "
                    "degrees: the phantom moved against the C-arm's path; take the run again",
                    number, moved_mm, turned_deg),
        {{"moved_mm", moved_mm}, {"turned_deg", turned_deg}, {"chi2", step->chi2}, {"limit", step_chi2}});
  return true;
}

/// Refuses the frames farthest from the path of the others; false if none is beyond the limit.
bool refuse_off_path(Sweep& sweep, const Joint& joint) {
  std::vector<double> off;
  for (const PathPoint& point : joint.smooth.points)
    off.push_back(chi2_excess(point.off_path_chi2, path_dof(joint)));
  const double worst = *std::ranges::max_element(off);
  if (!(worst > off_path_limit)) return false;
  constexpr double share = 0.7;  // a frame beside the worst may be off because of it
  for (std::size_t i = 0; i < off.size(); ++i)
    if (off[i] > std::max(off_path_limit, share * worst))
      refuse_frame(
          sweep.frames[joint.frames[i]], Reason::residual_too_large,
          fmt::format("the camera is {:.1f} standard deviations off the path of the other images, limit "
                      "{:g}: the phantom or the C-arm moved, or labels are wrong",
                      off[i], off_path_limit),
          {{"off_path_sigma", off[i]}, {"limit", off_path_limit}});
  return true;
}

std::vector<std::size_t> accepted_in(const Sweep& sweep) {
  std::vector<std::size_t> accepted;
  for (std::size_t i = 0; i < sweep.frames.size(); ++i)
    if (!sweep.frames[i].failure) accepted.push_back(i);
  return accepted;
}

/// The covariance of each camera, with what all frames share: errors of the phantom and of a plate's map.
std::vector<CameraMatrix> covariances_of(const Joint& joint, const Detector& detector,
                                         const std::vector<Eigen::Matrix3Xd>& errors,
                                         const std::optional<SharedMap>& map) {
  std::vector<CameraMatrix> covariances;
  for (const PathPoint& point : joint.smooth.points) covariances.push_back(point.camera_covariance);
  const auto add = [&](auto value_of) {
    std::vector<Eigen::MatrixXd> values;
    for (std::size_t i = 0; i < joint.at.size(); ++i)
      values.push_back(value_of(i, joint.fit.orbit.at(joint.angles_deg[i])));
    const auto shared = response(joint.observations, joint.prior, joint.smooth.stiffness, values);
    for (std::size_t i = 0; i < covariances.size(); ++i) covariances[i] += shared[i] * shared[i].transpose();
  };
  if (!std::ranges::all_of(errors, [](const auto& error) { return error.isZero(0); }))
    add([&](std::size_t i, const PlacedCamera& reference) {
      return value_by_phantom(joint.points[i], joint.at[i], joint.observations[i], reference, detector,
                              errors);
    });
  if (map)
    add([&](std::size_t i, const PlacedCamera& reference) {
      return value_by_pixels(joint.points[i], joint.at[i], joint.observations[i], reference, detector,
                             map->errors_at(joint.points[i].pixels));
    });
  return covariances;
}

/// The path where its source is as far along the turn as the frame's own: how far it is, no image says.
CameraVector path_beside(const PathPoint& point, const CameraVector& turn) {
  const auto along = turn.head<3>();
  if (along.isZero(0)) return point.path;
  return point.path + turn * (along.dot((point.camera - point.path).head<3>()) / along.squaredNorm());
}

void set_best(SweepFrame& frame, const Joint& joint, std::size_t i, const CameraMatrix& covariance,
              const Detector& detector) {
  const PlacedCamera reference = joint.fit.orbit.at(joint.angles_deg[i]);
  const PathPoint& point = joint.smooth.points[i];
  calibration::CalibratedView best = *frame.alone;
  best.view = view_of(joint.at[i], detector);
  best.dlt = geometry::factors_from_projection(best.view.projection());
  const Eigen::MatrixXd by = parameters_by_deviation(joint.at[i], reference, detector);
  best.covariance = by * covariance * by.transpose();
  const FramePoints& points = joint.points[i];
  Eigen::MatrixX2d off(points.points.size(), 2);
  for (std::size_t k = 0; k < points.points.size(); ++k)
    off.row(Eigen::Index(k)) = points.pixels[k] - best.view.project(points.points[k]);
  for (std::size_t k = 0; k < points.points.size(); ++k)
    frame.fiducials[points.balls[k]].residual_px = off.row(Eigen::Index(k)).norm();
  best.chi2 = (points.whitening * off).squaredNorm();
  best.reprojection_rms_px = std::sqrt(off.squaredNorm() / double(points.points.size()));
  const double fitted = (joint.observations[i].information * point.camera_covariance).trace();
  best.dof = int(std::lround(2 * double(points.points.size()) - fitted));
  frame.best = std::move(best);
  frame.path_angle_deg = joint.angles_deg[i];
  frame.off_path_sigma = chi2_excess(point.off_path_chi2, path_dof(joint));
  frame.flex = path_beside(point, joint.observations[i].turn);
  frame.own = point.camera;
  // The noise by all frames says what residuals are usual; of a hundred frames, some alone look inconsistent.
  constexpr double noticeable = 4, inconsistent = 3;
  const bool is_doubtful =
      *frame.off_path_sigma > noticeable ||
      (frame.best->dof > 0 && chi2_excess(frame.best->chi2, frame.best->dof) > inconsistent);
  frame.decision = is_doubtful ? Decision::warn : Decision::accept;
}

/// Nearest point to the central rays, source to the middle of the detector.
Eigen::Vector3d nearest_to_rays(const std::vector<PlacedCamera>& cameras, std::size_t skip_begin,
                                std::size_t skip_end) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (skip_begin <= i && i < skip_end) continue;
    const Eigen::Vector3d ray = (cameras[i].detector - cameras[i].source).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray * ray.transpose();
    sum += across;
    right += across * cameras[i].source;
  }
  return geometry::solve_spd(sum, right).solution;
}

/// Isocentre with the standard deviation of a jackknife over blocks of neighbouring frames.
void describe(SweepPath& path, const std::vector<PlacedCamera>& cameras) {
  path.isocentre = nearest_to_rays(cameras, 0, 0);
  const std::size_t blocks = std::min<std::size_t>(8, cameras.size() / 2);
  std::vector<Eigen::Vector3d> without;
  for (std::size_t b = 0; b < blocks; ++b)
    without.push_back(
        nearest_to_rays(cameras, b * cameras.size() / blocks, (b + 1) * cameras.size() / blocks));
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), squares = Eigen::Vector3d::Zero();
  for (const auto& at : without) mean += at / double(blocks);
  for (const auto& at : without) squares += (at - mean).cwiseAbs2();
  if (blocks > 1) path.isocentre_sigma = (squares * double(blocks - 1) / double(blocks)).cwiseSqrt();
  double to_axis = 0, to_detector = 0;
  for (const PlacedCamera& camera : cameras) {
    const Eigen::Vector3d ray = (camera.detector - camera.source).normalized();
    path.isocentre_radius_mm =
        std::max(path.isocentre_radius_mm, ray.cross(path.isocentre - camera.source).norm());
    const Eigen::Vector3d from = camera.source - path.isocentre;
    to_axis += (path.axis ? path.axis->cross(from).norm() : from.norm()) / double(cameras.size());
    to_detector += (camera.rotation * (camera.detector - camera.source)).z() / double(cameras.size());
  }
  path.source_to_axis_mm = to_axis;
  path.source_to_detector_mm = to_detector;
  const std::vector<double> angles_deg = fit_orbit(cameras, path.isocentre).angles_deg;
  const auto [least, most] = std::ranges::minmax(angles_deg);
  path.arc_deg = most - least;
}

/// The path through the frames' own estimates, of which nothing is changed.
void take_free_path(Sweep& sweep, const Eigen::Vector3d& centre) {
  std::vector<PlacedCamera> cameras;
  const std::vector<std::size_t> accepted = accepted_in(sweep);
  for (const std::size_t i : accepted) cameras.push_back(placed(sweep.frames[i].alone->view, sweep.detector));
  if (cameras.size() < 3) return;
  const OrbitFit fit = fit_orbit(cameras, centre);
  for (std::size_t k = 0; k < accepted.size(); ++k) {
    SweepFrame& frame = sweep.frames[accepted[k]];
    frame.path_angle_deg = fit.angles_deg[k];
    frame.own = deviation_of(cameras[k], fit.orbit.at(fit.angles_deg[k]));
  }
  SweepPath path;
  path.axis = fit.orbit.axis;
  describe(path, cameras);
  sweep.path = path;
}

Failure contradiction(const Sweep& sweep, std::size_t accepted, std::size_t estimated) {
  const auto example = std::ranges::find_if(sweep.frames, [](const SweepFrame& frame) {
    return frame.failure && frame.alone && frame.failure->figures.contains("limit");
  });
  Failure failure = *example->failure;
  failure.message = fmt::format("only {} of {} calibrated images agree on one path; {}: {}", accepted,
                                estimated, example->view, failure.message);
  failure.view.clear();
  return failure;
}

}  // namespace

std::optional<double> stated_distance_mm(const std::vector<FrameEstimate>& estimates) {
  for (const FrameEstimate& estimate : estimates)
    if (estimate.source_detector_mm) return estimate.source_detector_mm;
  return std::nullopt;
}

std::optional<Failure> estimate_path(Sweep& sweep, const pipeline::Case& base,
                                     const std::vector<FrameEstimate>& estimates, PathKind kind) {
  const Eigen::Vector3d centre = phantom::middle_of(base.calibrator);
  const std::size_t estimated = accepted_in(sweep).size();
  if (kind == PathKind::free || estimated < least_path) {
    take_free_path(sweep, centre);
    return std::nullopt;
  }
  const auto errors = phantom_errors(base.calibrator);
  const auto distance = sweep.pixel_known ? stated_distance_mm(estimates) : std::nullopt;
  bool moved = false;
  for (;;) {
    const std::vector<std::size_t> accepted = accepted_in(sweep);
    if (accepted.size() < least_path || (!moved && 2 * accepted.size() < estimated)) {
      for (SweepFrame& frame : sweep.frames) frame.best.reset();
      return contradiction(sweep, accepted.size(), estimated);
    }
    const Joint joint =
        joint_of(estimates, accepted, sweep.detector, base.calibrator, errors, distance, sweep.noise_factor);
    const bool moved_here = refuse_moved(sweep, joint);
    moved = moved || moved_here;
    if (moved_here || refuse_off_path(sweep, joint)) continue;
    const auto covariances =
        covariances_of(joint, sweep.detector, errors, shared_map_of(estimates, sweep.noise_factor));
    for (std::size_t i = 0; i < joint.frames.size(); ++i)
      set_best(sweep.frames[joint.frames[i]], joint, i, covariances[i], sweep.detector);
    SweepPath path;
    path.kind = PathKind::smooth;
    path.axis = joint.fit.orbit.axis;
    path.stiffness = joint.smooth.stiffness;
    describe(path, joint.at);
    if (!sweep.pixel_known) path.source_to_detector_mm.reset();
    sweep.path = path;
    return std::nullopt;
  }
}

}  // namespace helicarm::sweep
