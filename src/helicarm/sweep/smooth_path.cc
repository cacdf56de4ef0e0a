// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/smooth_path.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/sweep/chain.h"

namespace helicarm::sweep {
namespace {

// Of a step along the path: frames of a gantry that rests share a node, as shorter steps are all but rigid,
// and their information would hide the frames'.
constexpr double least_step_deg = 0.05;
// Of the path's first value (mm, mm, rad) and rate per degree: far beyond any C-arm's flex.
constexpr std::array first_sigma{100.0, 100.0, 0.5};
constexpr std::array rate_sigma{5.0, 5.0, 0.05};

CameraVector by_group(const Eigen::Vector3d& of_group) {
  return of_group.replicate(1, 3).transpose().reshaped();
}

CameraMatrix inverse_of(const CameraMatrix& matrix) {
  const CameraVector root = matrix.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd unit = root.asDiagonal() * matrix * root.asDiagonal();
  return root.asDiagonal() * geometry::inverse(unit) * root.asDiagonal();
}

double log_determinant(const CameraMatrix& matrix) {
  const CameraVector root = matrix.diagonal().cwiseSqrt().cwiseInverse();
  const CameraMatrix unit = root.asDiagonal() * matrix * root.asDiagonal();
  return geometry::log_determinant(unit).value_or(std::numeric_limits<double>::quiet_NaN()) -
         2 * root.array().log().sum();
}

/// A frame's jitter about the path: its information, without any on the turn.
struct Jitter {
  CameraMatrix information;
  double log_determinant;
};

Jitter jitter_of(const PathObservation& frame, const CameraVector& sigma) {
  const CameraVector weight = sigma.cwiseAbs2().cwiseInverse();
  Jitter jitter{weight.asDiagonal(), weight.array().log().sum()};
  if (frame.turn.isZero(0)) return jitter;
  const CameraVector weighted = weight.cwiseProduct(frame.turn);
  const double share = frame.turn.dot(weighted);
  jitter.information -= weighted * weighted.transpose() / share;
  jitter.log_determinant -= std::log(share / frame.turn.squaredNorm());
  return jitter;
}

/// The path's problem: each frame's information on the path, its jitter integrated out.
struct Problem {
  std::vector<CameraMatrix> about;  ///< (information + jitter's)^-1
  std::vector<CameraMatrix> on_path;
  std::vector<Jitter> jitter;
  std::vector<std::size_t> node;  ///< of the chain, of each frame
  Chain chain;
  double log_determinant = 0;  ///< terms of the likelihood without residuals
};

/// Angle of the first frame of each node.
std::vector<double> node_angles(const std::vector<PathObservation>& frames, std::vector<std::size_t>& node) {
  std::vector<double> angles;
  for (const PathObservation& frame : frames) {
    if (angles.empty() || frame.angle_deg - angles.back() >= least_step_deg)
      angles.push_back(frame.angle_deg);
    node.push_back(angles.size() - 1);
  }
  return angles;
}

Problem problem_of(const std::vector<PathObservation>& frames, const PathPrior& prior,
                   const Stiffness& stiffness) {
  const CameraVector sigma = by_group(stiffness.jitter), bend = by_group(stiffness.bend);
  std::vector<CameraMatrix> about, on_path;
  std::vector<Jitter> jitters;
  std::vector<std::size_t> node;
  const std::vector<double> angles = node_angles(frames, node);
  std::vector<ChainMatrix> diagonal(angles.size(), ChainMatrix::Zero()), next;
  double log_terms = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Jitter& jitter = jitters.emplace_back(jitter_of(frames[i], sigma));
    const CameraMatrix both = frames[i].information + jitter.information;
    about.push_back(inverse_of(both));
    // Information J (J + H)^-1 H is symmetric; this form keeps what is free at zero.
    const CameraMatrix reduced = jitter.information * about[i] * frames[i].information;
    on_path.emplace_back((reduced + reduced.transpose()) / 2);
    log_terms += jitter.log_determinant - sweep::log_determinant(both);
    auto of_node = diagonal[node[i]].topLeftCorner<camera_size, camera_size>();
    of_node += on_path[i];
    if (i == frames.size() / 2) of_node += prior.information;
  }
  for (Eigen::Index k = 0; k < camera_size; ++k) {
    diagonal[0](k, k) += std::pow(first_sigma[std::size_t(k / 3)], -2);
    diagonal[0](camera_size + k, camera_size + k) += std::pow(rate_sigma[std::size_t(k / 3)], -2);
  }
  for (std::size_t i = 0; i + 1 < angles.size(); ++i) {
    const double h = angles[i + 1] - angles[i];
    ChainMatrix& across = next.emplace_back(ChainMatrix::Zero());
    for (Eigen::Index k = 0; k < camera_size; ++k) {
      // Integrated random walk: covariance bend^2 [h^3/3 h^2/2; h^2/2 h] of the step.
      const double weight = std::pow(bend[k], -2);
      Eigen::Matrix2d step, walk;
      step << 12 / (h * h * h), -6 / (h * h), -6 / (h * h), 4 / h;
      step *= weight;
      walk << 1, h, 0, 1;
      const auto add = [&](ChainMatrix& to, const Eigen::Matrix2d& block) {
        for (Eigen::Index r = 0; r < 2; ++r)
          for (Eigen::Index c = 0; c < 2; ++c) to(r * camera_size + k, c * camera_size + k) += block(r, c);
      };
      add(diagonal[i], walk.transpose() * step * walk);
      add(diagonal[i + 1], step);
      add(across, -walk.transpose() * step);
      log_terms += std::log(step.determinant());
    }
  }
  Problem problem{std::move(about),
                  std::move(on_path),
                  std::move(jitters),
                  std::move(node),
                  Chain(std::move(diagonal), std::move(next)),
                  0};
  problem.log_determinant = (log_terms - problem.chain.log_determinant()) / 2;
  return problem;
}

Eigen::MatrixXd on_chain(const Eigen::MatrixXd& of_camera) {
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(chain_size, of_camera.cols());
  right.topRows<camera_size>() = of_camera;
  return right;
}

/// The path's values at each frame, for observations with these values.
std::vector<Eigen::MatrixXd> path_for(const Problem& problem, const std::vector<Eigen::MatrixXd>& values,
                                      const CameraVector* prior_gradient) {
  std::vector<Eigen::MatrixXd> right(problem.node.back() + 1,
                                     Eigen::MatrixXd::Zero(chain_size, values.front().cols()));
  for (std::size_t i = 0; i < values.size(); ++i) {
    auto of_node = right[problem.node[i]].topRows<camera_size>();
    of_node += problem.on_path[i] * values[i];
    if (prior_gradient && i == values.size() / 2) of_node += *prior_gradient;
  }
  const auto solved = problem.chain.solve(std::move(right));
  std::vector<Eigen::MatrixXd> path;
  for (const std::size_t node : problem.node) path.push_back(solved[node]);
  return path;
}

std::vector<Eigen::MatrixXd> values_of(const std::vector<PathObservation>& frames) {
  std::vector<Eigen::MatrixXd> values;
  for (const PathObservation& frame : frames) values.emplace_back(frame.value);
  return values;
}

double log_likelihood(const std::vector<PathObservation>& frames, const PathPrior& prior,
                      const Problem& problem, const std::vector<Eigen::MatrixXd>& path) {
  // y' V^-1 y = sum of y' H (y - x), of zero mean; the prior's part likewise.
  double chi2 = 0;
  for (std::size_t i = 0; i < frames.size(); ++i)
    chi2 += frames[i].value.dot(problem.on_path[i] * (frames[i].value - path[i].topRows<camera_size>()));
  chi2 -= prior.gradient.dot(path[frames.size() / 2].topRows<camera_size>().col(0));
  return problem.log_determinant - chi2 / 2;
}

/// Logarithms of bend, of the root mean square of the source's and the detector's jitter, of the detector's
/// over the source's and of the rotation's, and what is known of them: flex of some mm over a turn (Daly et
/// al. 2008, Fahrig and Holdsworth 2000), jitter of 0.02 to 0.25 mm, alike at both ends of one arm: along
/// most directions the images show their sum alone.
using LogStiffness = Eigen::Matrix<double, 6, 1>;
const LogStiffness typical_logs{std::log(4e-3), std::log(8e-3), std::log(3e-5), std::log(0.05), 0,
                                std::log(1e-4)};
const LogStiffness spread_of_logs{2, 2, 2, 1.5, 0.5, 1.5};

Stiffness stiffness_of(const LogStiffness& logs) {
  const double ratio = std::exp(logs[4]), of_source = std::exp(logs[3]) * std::sqrt(2 / (1 + ratio * ratio));
  return {logs.head<3>().array().exp(), {of_source, of_source * ratio, std::exp(logs[5])}};
}

LogStiffness logs_of(const Stiffness& stiffness) {
  LogStiffness logs;
  const double of_source = stiffness.jitter[0], of_detector = stiffness.jitter[1];
  logs << stiffness.bend.array().log(), std::log(std::hypot(of_source, of_detector) / std::sqrt(2.0)),
      std::log(of_detector / of_source), std::log(stiffness.jitter[2]);
  return logs;
}

double posterior_of(const std::vector<PathObservation>& frames, const PathPrior& prior,
                    const LogStiffness& logs) {
  const Problem problem = problem_of(frames, prior, stiffness_of(logs));
  const auto path = path_for(problem, values_of(frames), &prior.gradient);
  const double value = log_likelihood(frames, prior, problem, path) -
                       (logs - typical_logs).cwiseQuotient(spread_of_logs).squaredNorm() / 2;
  return std::isfinite(value) ? value : -1e300;
}

}  // namespace

Stiffness choose_stiffness(const std::vector<PathObservation>& frames, const PathPrior& prior,
                           const std::optional<Stiffness>& start) {
  // Coordinate search with steps that grow where they gain and shrink where they do not.
  LogStiffness at = typical_logs, step = LogStiffness::Constant(1);
  if (start) {
    at = logs_of(*start);
    step.setConstant(0.5);
  }
  double best = posterior_of(frames, prior, at);
  constexpr int most_rounds = 30;
  constexpr double least_step = 0.1;
  for (int round = 0; round < most_rounds && step.maxCoeff() > least_step; ++round)
    for (Eigen::Index k = 0; k < at.size(); ++k) {
      if (step[k] <= least_step) continue;
      bool gained = false;
      for (const double sign : {1.0, -1.0}) {
        LogStiffness next = at;
        next[k] += sign * step[k];
        if (const double value = posterior_of(frames, prior, next); value > best) {
          best = value, at = next, gained = true;
          break;
        }
      }
      step[k] *= gained ? 1.3 : 0.4;
    }
  return stiffness_of(at);
}

SmoothPath smooth_path(const std::vector<PathObservation>& frames, const PathPrior& prior,
                       const Stiffness& stiffness) {
  const Problem problem = problem_of(frames, prior, stiffness);
  const auto path = path_for(problem, values_of(frames), &prior.gradient);
  const std::vector<ChainMatrix> covariances = problem.chain.covariances();
  SmoothPath smooth{stiffness, log_likelihood(frames, prior, problem, path), {}};
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const PathObservation& frame = frames[i];
    PathPoint& point = smooth.points.emplace_back();
    point.path = path[i].topRows<camera_size>();
    const ChainMatrix& covariance = covariances[problem.node[i]];
    point.path_covariance = covariance.topLeftCorner<camera_size, camera_size>();
    // Given the path, the frame lies between it and its own value.
    const CameraMatrix& about = problem.about[i];
    const CameraMatrix to_path = about * problem.jitter[i].information;
    point.camera = about * frame.information * frame.value + to_path * point.path;
    point.camera_covariance = about + to_path * point.path_covariance * to_path.transpose();
    // The others' path: this frame's information taken from the node.
    const ChainMatrix information = geometry::inverse(covariance);
    ChainMatrix without = information;
    without.topLeftCorner<camera_size, camera_size>() -= problem.on_path[i];
    const ChainMatrix of_others = geometry::inverse(without);
    const ChainVector at =
        of_others * (information * path[i].col(0) - on_chain(problem.on_path[i] * frame.value).col(0));
    const CameraVector off = frame.value - at.head<camera_size>();
    // Residual's information, the turn left free: (path's^-1 + on_path^-1)^-1 without an inverse of on_path.
    const CameraMatrix of_path = of_others.topLeftCorner<camera_size, camera_size>();
    const CameraMatrix mixed = CameraMatrix::Identity() + of_path * problem.on_path[i];
    point.off_path_chi2 = off.dot(problem.on_path[i] * (geometry::inverse(mixed) * off));
  }
  return smooth;
}

std::vector<Eigen::MatrixXd> response(const std::vector<PathObservation>& frames, const PathPrior& prior,
                                      const Stiffness& stiffness,
                                      const std::vector<Eigen::MatrixXd>& values) {
  const Problem problem = problem_of(frames, prior, stiffness);
  const auto path = path_for(problem, values, nullptr);
  std::vector<Eigen::MatrixXd> cameras;
  for (std::size_t i = 0; i < frames.size(); ++i)
    cameras.emplace_back(problem.about[i] * (frames[i].information * values[i] +
                                             problem.jitter[i].information * path[i].topRows<camera_size>()));
  return cameras;
}

namespace {

/// The step that explains the frames best at this stiffness.
std::optional<PhantomStep> best_step(const std::vector<PathObservation>& frames, const PathPrior& prior,
                                     const Stiffness& stiffness, const std::vector<std::size_t>& order) {
  constexpr std::size_t least_frames = 3;  // on either side
  // A turn about the axis is free: of what the images do not determine, the least is taken.
  constexpr double plausible_rad = 0.1, plausible_mm = 20;
  Eigen::Matrix<double, 6, 6> plausible = Eigen::Matrix<double, 6, 6>::Zero();
  plausible.diagonal().head<3>().setConstant(1 / (plausible_rad * plausible_rad));
  plausible.diagonal().tail<3>().setConstant(1 / (plausible_mm * plausible_mm));
  const Problem problem = problem_of(frames, prior, stiffness);
  const auto path = path_for(problem, values_of(frames), &prior.gradient);
  std::optional<PhantomStep> best;
  for (std::size_t first = least_frames; first + least_frames <= order.size(); ++first) {
    std::vector<Eigen::MatrixXd> moved(frames.size(), Eigen::MatrixXd::Zero(camera_size, 6));
    for (std::size_t k = first; k < order.size(); ++k) moved[order[k]] = frames[order[k]].motion;
    const auto followed = path_for(problem, moved, nullptr);
    Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
    for (std::size_t k = first; k < order.size(); ++k) {
      const std::size_t i = order[k];
      const Eigen::Matrix<double, 6, camera_size> weighted =
          frames[i].motion.transpose() * problem.on_path[i];
      information += weighted * (frames[i].motion - followed[i].topRows<camera_size>());
      gradient += weighted * (frames[i].value - path[i].topRows<camera_size>());
    }
    const Eigen::Matrix<double, 6, 1> motion =
        geometry::solve_spd(information + plausible, gradient).solution;
    const double chi2 = gradient.dot(motion);
    if (std::isfinite(chi2) && (!best || chi2 > best->chi2)) best = PhantomStep{first, motion, chi2};
  }
  return best;
}

}  // namespace

std::optional<PhantomStep> find_step(const std::vector<PathObservation>& frames, const PathPrior& prior,
                                     const Stiffness& stiffness, const std::vector<std::size_t>& order) {
  constexpr int rounds = 3;
  const double without = posterior_of(frames, prior, logs_of(stiffness));
  std::optional<PhantomStep> best;
  Stiffness at = stiffness;
  for (int round = 0; round < rounds; ++round) {
    const auto step = best_step(frames, prior, at, order);
    if (!step) return best;
    std::vector<PathObservation> corrected = frames;
    for (std::size_t k = step->first; k < order.size(); ++k)
      corrected[order[k]].value -= frames[order[k]].motion * step->motion;
    at = choose_stiffness(corrected, prior, at);
    const double gain = 2 * (posterior_of(corrected, prior, logs_of(at)) - without);
    if (best && gain <= best->chi2) break;
    best = PhantomStep{step->first, step->motion, gain};
  }
  return best;
}

}  // namespace helicarm::sweep
