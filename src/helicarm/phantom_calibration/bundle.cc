// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/bundle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include <Eigen/SparseCore>
#include <ceres/ceres.h>
#include <fmt/format.h>
#include <glog/logging.h>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/phantom_calibration/gauge.h"
#include "helicarm/phantom_calibration/image_cost.h"

namespace helicarm::phantom_calibration {
namespace {

constexpr double least_own_share = 0.1;  // of an image's variance beside the map's
constexpr double least_freedom = 1e-6;   // of an image that its own centre fits exactly

/// (value - mean - shared) / sigma; without the shared block (value - mean) / sigma.
class PriorCost final : public ceres::CostFunction {
 public:
  PriorCost(int size, int at, double mean, double unit, double sigma, int shared = -1)
      : at_(at), shared_(shared), mean_(mean), unit_(unit), sigma_(sigma) {
    *mutable_parameter_block_sizes() = {size};
    if (shared >= 0) mutable_parameter_block_sizes()->push_back(3);
    set_num_residuals(1);
  }
  bool Evaluate(const double* const* x, double* residual, double** jacobians) const override {
    *residual = ((x[0][at_] - mean_) / unit_ - (shared_ < 0 ? 0 : x[1][shared_])) / sigma_;
    if (!jacobians) return true;
    if (jacobians[0]) {
      std::fill_n(jacobians[0], parameter_block_sizes()[0], 0.0);
      jacobians[0][at_] = 1 / (unit_ * sigma_);
    }
    if (shared_ >= 0 && jacobians[1]) {
      std::fill_n(jacobians[1], 3, 0.0);
      jacobians[1][shared_] = -1 / sigma_;
    }
    return true;
  }

 private:
  int at_, shared_;
  double mean_, unit_, sigma_;
};

struct ViewBlocks {
  std::array<double, pose_size> pose;
  std::array<double, intrinsics_size> intrinsics;
  bool mirrored;
  Eigen::MatrixXd whitening;
};

/// The problem as Ceres holds it.
struct Blocks {
  std::vector<std::array<double, 3>> centres;
  std::vector<ViewBlocks> views;
  std::array<double, 3> c_arm{};  ///< focal length and principal point from nominal, in views' units
  ceres::Problem problem;
};

std::optional<Eigen::MatrixXd> whitening_of(const BundleView& view, bool robust) {
  const auto n = Eigen::Index(view.images.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
  if (view.map_covariance_px2.rows() == n) covariance = view.map_covariance_px2;
  for (Eigen::Index i = 0; i < n; ++i)
    covariance(i, i) +=
        std::max(std::pow(view.images[std::size_t(i)].sigma_px, 2), least_own_share * covariance(i, i));
  if (robust) covariance = Eigen::MatrixXd(covariance.diagonal().asDiagonal());
  return geometry::whitening(covariance);
}

void add_images(Blocks& blocks, const BundleProblem& problem, std::size_t v, const BundleOptions& options) {
  ViewBlocks& view = blocks.views[v];
  std::vector<Eigen::Vector2d> images;
  std::vector<double*> all = {view.pose.data(), view.intrinsics.data()};
  for (const FiducialImage& image : problem.views[v].images) {
    double* centre = blocks.centres[image.fiducial].data();
    images.push_back(image.uv);
    all.push_back(centre);
    if (!options.robust) continue;
    const auto i = Eigen::Index(images.size()) - 1;
    blocks.problem.AddResidualBlock(
        new ImageCost({image.uv}, view.whitening.block(i, i, 1, 1), view.mirrored), new ceres::CauchyLoss(3),
        {view.pose.data(), view.intrinsics.data(), centre});
  }
  if (!options.robust)
    blocks.problem.AddResidualBlock(new ImageCost(std::move(images), view.whitening, view.mirrored), nullptr,
                                    all);
  blocks.problem.SetManifold(view.pose.data(), new PoseManifold);
}

bool has_nominal_focal(const BundleProblem& problem) {
  return std::ranges::all_of(problem.views, [](const BundleView& v) { return v.prior.focal_px.has_value(); });
}

void add_priors(Blocks& blocks, const BundleProblem& problem, std::size_t v) {
  const geometry::IntrinsicsPrior& prior = problem.views[v].prior;
  ViewBlocks& view = blocks.views[v];
  double* own = view.intrinsics.data();
  double* shared = blocks.c_arm.data();
  const auto add = [&](int at, double mean, double unit, double sigma, int of_c_arm) {
    auto* cost = new PriorCost(intrinsics_size, at, mean, unit, sigma, of_c_arm);
    if (of_c_arm < 0)
      blocks.problem.AddResidualBlock(cost, nullptr, own);
    else
      blocks.problem.AddResidualBlock(cost, nullptr, own, shared);
  };
  if (prior.aspect) add(1, prior.aspect->value, 1, prior.aspect->sigma, -1);
  if (problem.c_arm.focal)
    add(0, has_nominal_focal(problem) ? *prior.focal_px : 0, prior.unit_px, problem.c_arm.focal->of_view, 0);
  if (!prior.principal_px || !problem.c_arm.principal) return;
  const double sigma = problem.c_arm.principal->of_view;
  add(2, prior.principal_px->x(), (view.mirrored ? -1 : 1) * prior.unit_px, sigma, 1);
  add(3, prior.principal_px->y(), prior.unit_px, sigma, 2);
}

void add_c_arm(Blocks& blocks, const BundleProblem& problem) {
  double* shared = blocks.c_arm.data();
  if (!blocks.problem.HasParameterBlock(shared)) return;
  const bool nominal = has_nominal_focal(problem);
  if (problem.c_arm.focal && nominal)
    blocks.problem.AddResidualBlock(new PriorCost(3, 0, 0, 1, problem.c_arm.focal->common), nullptr, shared);
  if (problem.c_arm.principal)
    for (const int axis : {1, 2})
      blocks.problem.AddResidualBlock(new PriorCost(3, axis, 0, 1, problem.c_arm.principal->common), nullptr,
                                      shared);
  if (problem.c_arm.focal && nominal) return;
  double mean = 0;
  for (std::size_t v = 0; v < problem.views.size(); ++v)
    mean += blocks.views[v].intrinsics[0] / problem.views[v].prior.unit_px / double(problem.views.size());
  shared[0] = mean;
}

Expected<void> fill(Blocks& blocks, const BundleProblem& problem, const BundleOptions& options) {
  for (const Eigen::Vector3d& centre : problem.centres)
    blocks.centres.push_back({centre.x(), centre.y(), centre.z()});
  blocks.views.resize(problem.views.size());
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    const BundleView& from = problem.views[v];
    ViewBlocks& view = blocks.views[v];
    write_pose(from.start.camera_from_world, view.pose.data());
    write_intrinsics(from.start.intrinsics, view.intrinsics.data());
    view.mirrored = from.start.intrinsics.fx < 0;
    auto whitening = whitening_of(from, options.robust);
    if (!whitening)
      return fail(Reason::uncertain,
                  fmt::format("the covariance of the images in view {} is not positive definite", from.name));
    view.whitening = *std::move(whitening);
    add_images(blocks, problem, v, options);
    blocks.problem.SetParameterLowerBound(view.intrinsics.data(), 0, 1);
    blocks.problem.SetParameterLowerBound(view.intrinsics.data(), 1, 0.5);
  }
  for (std::size_t v = 0; v < problem.views.size(); ++v) add_priors(blocks, problem, v);  // after all images
  add_c_arm(blocks, problem);
  if (options.fixed_centres)
    for (std::size_t i = 0; i < blocks.centres.size(); ++i)
      if (options.free_centre != i && blocks.problem.HasParameterBlock(blocks.centres[i].data()))
        blocks.problem.SetParameterBlockConstant(blocks.centres[i].data());
  return {};
}

/// Whitened residuals and their dense Jacobian by the tangent spaces: centres, then all else.
struct Linear {
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  Eigen::Index of_centres = 0;  ///< columns
};

Linear linearised(Blocks& blocks, const BundleOptions& options) {
  std::vector<double*> order;
  Linear linear;
  if (!options.fixed_centres)
    for (auto& centre : blocks.centres) order.push_back(centre.data());
  linear.of_centres = 3 * Eigen::Index(order.size());
  if (options.fixed_centres && options.free_centre)
    order.push_back(blocks.centres[*options.free_centre].data());
  for (ViewBlocks& view : blocks.views) {
    order.push_back(view.pose.data());
    order.push_back(view.intrinsics.data());
  }
  if (blocks.problem.HasParameterBlock(blocks.c_arm.data())) order.push_back(blocks.c_arm.data());
  ceres::Problem::EvaluateOptions evaluation;
  evaluation.parameter_blocks = order;
  std::vector<double> residuals;
  ceres::CRSMatrix sparse;
  blocks.problem.Evaluate(evaluation, nullptr, &residuals, nullptr, &sparse);
  linear.residuals = Eigen::Map<Eigen::VectorXd>(residuals.data(), Eigen::Index(residuals.size()));
  linear.jacobian = Eigen::MatrixXd::Zero(sparse.num_rows, sparse.num_cols);
  for (int row = 0; row < sparse.num_rows; ++row)
    for (int k = sparse.rows[std::size_t(row)]; k < sparse.rows[std::size_t(row) + 1]; ++k)
      linear.jacobian(row, sparse.cols[std::size_t(k)]) = sparse.values[std::size_t(k)];
  return linear;
}

/// Covariance of all columns, with inner constraints on the centres. Nothing where more is undetermined.
std::optional<Eigen::MatrixXd> covariance_of(const Linear& linear, std::span<const Eigen::Vector3d> centres) {
  const Eigen::VectorXd unit = linear.jacobian.colwise().norm().cwiseMax(1e-300).cwiseInverse().transpose();
  const Eigen::Index c = linear.of_centres, others = linear.jacobian.cols() - c;
  const Eigen::MatrixXd of_others = linear.jacobian.rightCols(others) * unit.tail(others).asDiagonal();
  const auto by_centres = linear.jacobian.leftCols(c);
  const Eigen::MatrixXd cross = of_others.transpose() * by_centres;
  Eigen::MatrixXd right(others, others + c);
  right << Eigen::MatrixXd::Identity(others, others), cross;
  const auto [inner, rcond] = geometry::solve_spd(of_others.transpose() * of_others, right);
  if (!(rcond > 1e-15)) return std::nullopt;
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(linear.jacobian.cols(), linear.jacobian.cols());
  Eigen::MatrixXd corner = inner.leftCols(others);
  if (c > 0) {
    const Eigen::MatrixXd carried = inner.rightCols(c);
    Eigen::MatrixXd normal = by_centres.transpose() * by_centres - cross.transpose() * carried;
    normal = (normal + normal.transpose()).eval() / 2;
    const auto covariance = inner_constraint_covariance(normal, similarity_motions(centres));
    if (!covariance) return std::nullopt;
    all.topLeftCorner(c, c) = *covariance;
    const Eigen::MatrixXd mixed = -carried * *covariance;
    all.bottomLeftCorner(others, c) = unit.tail(others).asDiagonal() * mixed;
    all.topRightCorner(c, others) = all.bottomLeftCorner(others, c).transpose();
    corner -= mixed * carried.transpose();
  }
  all.bottomRightCorner(others, others) =
      unit.tail(others).asDiagonal() * corner * unit.tail(others).asDiagonal();
  return all;
}

/// Mean-shift test of each image (Baarda 1968), images correlated as they are.
std::vector<std::vector<double>> falls_of(const Blocks& blocks, const Linear& linear,
                                          const Eigen::MatrixXd& covariance) {
  std::vector<std::vector<double>> falls;
  Eigen::Index row = 0;
  for (const ViewBlocks& view : blocks.views) {
    const Eigen::Index n = view.whitening.rows();
    Eigen::MatrixXd weight = Eigen::MatrixXd::Zero(2 * n, 2 * n);
    weight.topLeftCorner(n, n) = weight.bottomRightCorner(n, n) = view.whitening;
    // Ceres orders a cost's residuals as it is given them: all u, then all v.
    const auto j = linear.jacobian.middleRows(row, 2 * n);
    const Eigen::MatrixXd freedom =
        weight.transpose() * (Eigen::MatrixXd::Identity(2 * n, 2 * n) - j * covariance * j.transpose()) *
        weight;
    const Eigen::VectorXd weighted = weight.transpose() * linear.residuals.segment(row, 2 * n);
    auto& of_view = falls.emplace_back();
    for (Eigen::Index i = 0; i < n; ++i) {
      Eigen::Matrix2d own;
      own << freedom(i, i), freedom(i, n + i), freedom(n + i, i), freedom(n + i, n + i);
      const double size = view.whitening.col(i).squaredNorm();
      const auto [values, vectors] = geometry::symmetric_eigen(own);
      const Eigen::Vector2d r = vectors.transpose() * Eigen::Vector2d(weighted[i], weighted[n + i]);
      double fall = 0;
      for (Eigen::Index k = 0; k < 2; ++k)
        if (values[k] > least_freedom * size) fall += r[k] * r[k] / values[k];
      of_view.push_back(fall);
    }
    row += 2 * n;
  }
  return falls;
}

void describe(BundleFit& fit, const Blocks& blocks, const BundleProblem& problem) {
  double sum = 0;
  std::size_t count = 0;
  for (const auto& centre : blocks.centres) fit.centres.emplace_back(centre.data());
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    const ViewBlocks& view = blocks.views[v];
    fit.views.push_back(
        {read_intrinsics(view.intrinsics.data(), view.mirrored), read_pose(view.pose.data())});
    auto& residuals = fit.residuals_px.emplace_back();
    for (const FiducialImage& image : problem.views[v].images) {
      residuals.push_back(fit.views.back().project(fit.centres[image.fiducial]) - image.uv);
      sum += residuals.back().squaredNorm();
      count += 2;
    }
  }
  fit.rms_px = std::sqrt(sum / double(std::max<std::size_t>(1, count)));
}

/// Ceres reports through glog, which writes to stderr unless the program has set it up.
void silence_ceres() {
  if (!google::IsGoogleLoggingInitialized()) FLAGS_minloglevel = google::GLOG_FATAL;
}

}  // namespace

Expected<BundleFit> adjust(const BundleProblem& problem, const BundleOptions& options) {
  for (const BundleView& view : problem.views)
    if (view.images.empty())
      return fail(Reason::uncertain, fmt::format("no ball is seen in view {}", view.name));
  Blocks blocks;
  if (const auto filled = fill(blocks, problem, options); !filled)
    return tl::unexpected<Failure>(filled.error());
  silence_ceres();
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_QR;
  solver.max_num_iterations = options.most_iterations;
  solver.function_tolerance = 1e-12;
  solver.parameter_tolerance = 1e-12;
  solver.gradient_tolerance = 1e-14;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &blocks.problem, &summary);
  if (!summary.IsSolutionUsable())
    return fail(Reason::uncertain,
                "the images do not determine the phantom: the adjustment does not converge");
  BundleFit fit;
  describe(fit, blocks, problem);
  fit.chi2 = 2 * summary.final_cost;
  if (options.robust) return fit;
  const Linear linear = linearised(blocks, options);
  const auto covariance = covariance_of(linear, fit.centres);
  if (!covariance)
    return fail(Reason::uncertain,
                "the images do not determine the phantom: the normal equations are singular");
  constexpr int gauge = 7;
  fit.dof = int(linear.jacobian.rows() - linear.jacobian.cols()) + (options.fixed_centres ? 0 : gauge);
  fit.falls = falls_of(blocks, linear, *covariance);
  const Eigen::Index columns = options.fixed_centres ? (options.free_centre ? 3 : 0) : linear.of_centres;
  fit.covariance_mm2 = covariance->topLeftCorner(columns, columns);
  return fit;
}

}  // namespace helicarm::phantom_calibration
