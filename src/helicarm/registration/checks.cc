// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/checks.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/small_matrix.h"
#include "helicarm/registration/covariance.h"

namespace helicarm::registration {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr double strain_prior = 0.05;
constexpr double no_strain = 1e-6;
constexpr double least_edge_ratio = 1e-4, most_edge_ratio = 16;  // of variances
constexpr int xx = 0, xy = 3, xz = 4;                            // of a strain
constexpr int least_patches = 8, least_contour_points = 12;      // of a view
constexpr double least_patch_score = 0.4;
constexpr double least_contour_score = 0.6;
constexpr double clear_patch_score = 0.45;  // 0.41 in a view of a mirrored tibia, 0.46 to 0.5 in heads' views
constexpr double clearly_mirrored_ratio = 0.9;
constexpr double least_mirrored_ratio = 1.02;  // of a nearly symmetric bone 1.05 to 1.1
constexpr double least_runner_up_ratio = 1.1;
constexpr double most_strain = 0.012;
constexpr double doubtful_strain = 0.008;         // of two or more views
constexpr double most_strain_of_one_view = 0.05;  // what is not modelled passes for 3 to 4 % there
constexpr double strain_sigmas = 2;
constexpr double most_disagreement_mm = 0.5;
constexpr double disagreement_sigmas = 3;
constexpr double most_disagreement_ratio =
    4;                               // chi-square per degree of freedom; by chance once in 2000 registrations
constexpr double refused_ratio = 9;  // three standard deviations
constexpr double refused_ratio_exact = 50;  // cameras of unknown error
constexpr double most_search_mm = 100, most_search_deg = 90;

RigidCovariance inverse_of(const RigidCovariance& matrix) {
  return geometry::solve_spd(matrix, RigidCovariance::Identity()).solution;
}

}  // namespace

namespace {

/// One pose and size for the own solutions, the size in its standard deviations.
struct PoseAndSize {
  Eigen::Matrix<double, 7, 7> information = Eigen::Matrix<double, 7, 7>::Zero();
  Eigen::Matrix<double, 7, 1> sum = Eigen::Matrix<double, 7, 1>::Zero();
  double squares = 0;

  explicit PoseAndSize(const std::vector<OwnSolution>& own) {
    information(6, 6) = 1;
    for (const OwnSolution& each : own) {
      Eigen::Matrix<double, 6, 7> map;
      map << RigidCovariance::Identity(), each.by_scale;
      const Eigen::Matrix<double, 7, 6> weighted = map.transpose() * inverse_of(each.covariance);
      information += weighted * map;
      sum += weighted * each.step;
      squares += sum_of_squares(each);
    }
  }
  Eigen::Matrix<double, 7, 1> solution() const { return geometry::solve_spd(information, sum).solution; }

 private:
  static double sum_of_squares(const OwnSolution& each) {
    return each.step.dot(inverse_of(each.covariance) * each.step);
  }
};

/// The standard deviations of the model's size by which the own solutions agree best.
double common_scale(const std::vector<OwnSolution>& own) { return PoseAndSize(own).solution()[6]; }

/// Log density of the differences between own solutions of one pose and size (restricted likelihood), up to a
/// constant.
std::optional<double> log_density_of_differences(const std::vector<OwnSolution>& own) {
  const PoseAndSize one(own);
  double doubled = one.squares - one.sum.dot(one.solution());
  for (const OwnSolution& each : own) {
    const auto spread = geometry::log_determinant(each.covariance);
    if (!spread) return std::nullopt;
    doubled += *spread;
  }
  const auto known = geometry::log_determinant(one.information);
  return known ? std::optional(-(doubled + *known) / 2) : std::nullopt;
}

}  // namespace

OwnSolution OwnSolution::with_edges(double ratio) const {
  OwnSolution changed = *this;
  changed.covariance += (ratio - 1) * by_edges;
  changed.by_edges = ratio * by_edges;
  return changed;
}

Disagreement disagreement_of(const std::vector<RegistrationView>& views, const Vector3d& centre,
                             const std::vector<OwnSolution>& found) {
  std::vector<OwnSolution> own = found;
  const double scale = common_scale(own);
  for (OwnSolution& each : own) each.step -= scale * each.by_scale;
  Disagreement result;
  result.chi2 = scale * scale;
  result.dof = 6 * (int(own.size()) - 1);
  RigidCovariance total = RigidCovariance::Zero();
  RigidStep weighted = RigidStep::Zero();
  std::vector<RigidCovariance> weights;
  for (const OwnSolution& each : own) {
    weights.push_back(inverse_of(each.covariance));
    total += weights.back();
    weighted += weights.back() * each.step;
  }
  const RigidStep mean = geometry::solve_spd(total, weighted).solution;
  for (std::size_t i = 0; i < own.size(); ++i) {
    const RigidStep apart = own[i].step - mean;
    result.chi2 += apart.dot(weights[i] * apart);
    const RigidCovariance others = total - weights[i];
    const RigidStep from_others =
        own[i].step - geometry::solve_spd(others, weighted - weights[i] * own[i].step).solution;
    // The other view whose rays cross this one's most steeply.
    Vector3d axis = Vector3d::Zero();
    const auto ray = [&](std::size_t k) { return (centre - views[k].view.source_in_world()).normalized(); };
    for (std::size_t j = 0; j < own.size(); ++j)
      if (j != i && ray(i).cross(ray(j)).norm() > axis.norm()) axis = ray(i).cross(ray(j));
    axis.normalize();
    const double distance = std::abs(axis.dot(from_others.tail<3>()));
    result.held_out_mm.push_back(distance);
    if (distance >= result.distance_mm) {
      result.distance_mm = distance;
      const RigidCovariance both = own[i].covariance + inverse_of(others);
      result.sigma_mm = std::sqrt(axis.dot(both.bottomRightCorner<3, 3>() * axis));
    }
  }
  return result;
}

namespace {

/// Pose and strain, the strain under its prior. Its unit of information is that of the comparisons' weights.
Problem pose_and_strain(const Observation& observation, const ErrorModel& errors, const Vector3d& centre) {
  const Linearised plain = linearised(observation, {}, errors.correlation_px);
  const double unit = geometry::solve_spd(plain.information, plain.meat).solution.trace() / 6;
  Problem problem{{}, MatrixXd(affine_parameters, 12), MatrixXd::Zero(12, 12)};
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  problem.prior.bottomRightCorner<6, 6>().diagonal().setConstant(unit / (strain_prior * strain_prior));
  if (errors.views.size() == 1) {
    const Vector3d ray = centre - errors.views.front().view.source_in_world();
    axes = geometry::rotation_between(Vector3d::UnitX(), ray);
    for (const int along_ray : {xx, xy, xz})
      problem.prior(6 + along_ray, 6 + along_ray) = unit / (no_strain * no_strain);
  }
  problem.map << affine_from_rigid(), affine_from_strain(axes);
  return problem;
}

}  // namespace

double edge_variance_ratio(const Observation& observation, const ErrorModel& errors, const Vector3d& centre,
                           const std::vector<OwnSolution>& own) {
  const Problem problem = pose_and_strain(observation, errors, centre);
  const Linearised both = linearised(observation, problem, errors.correlation_px);
  const auto of_strain = [](const MatrixXd& covariance) -> Eigen::Matrix<double, 6, 6> {
    return covariance.bottomRightCorner<6, 6>();
  };
  const Eigen::VectorXd step = geometry::solve_spd(both.information, both.gradient).solution;
  const Eigen::Matrix<double, 6, 1> strain = step.tail<6>();
  Eigen::Matrix<double, 6, 1> size = Eigen::Matrix<double, 6, 1>::Zero();
  size.head<3>().setConstant(errors.scale_sigma);
  const Eigen::Matrix<double, 6, 6> other = of_strain(both.covariance()) +
                                            of_strain(errors.of_cameras(observation, centre, problem)) +
                                            size * size.transpose();
  const Eigen::Matrix<double, 6, 6> edges = of_strain(errors.of_edges(observation, centre, problem));
  constexpr int steps = 60;
  std::vector<double> ratios, logs;
  for (int i = 0; i <= steps; ++i) {
    const double ratio = least_edge_ratio * std::pow(most_edge_ratio / least_edge_ratio, double(i) / steps);
    const geometry::Matrix6d covariance = other + ratio * edges;
    const auto spread = geometry::log_determinant(covariance);
    if (!spread) return 1;
    std::vector<OwnSolution> by_ratio;
    for (const OwnSolution& each : own) by_ratio.push_back(each.with_edges(ratio));
    const auto differences = log_density_of_differences(by_ratio);
    if (!differences) return 1;
    ratios.push_back(ratio);
    logs.push_back(*differences - (*spread + geometry::squared_distance(strain, covariance)) / 2);
  }
  double sum = 0, weights = 0;
  for (std::size_t i = 0; i < logs.size(); ++i) {
    const double weight = std::exp(logs[i] - *std::ranges::max_element(logs));
    sum += weight * ratios[i];
    weights += weight;
  }
  return weights > 0 ? sum / weights : 1;
}

Deformation deformation_of(const Observation& observation, const ErrorModel& errors, const Vector3d& centre) {
  const Problem problem = pose_and_strain(observation, errors, centre);
  const Linearised both = linearised(observation, problem, errors.correlation_px);
  const Eigen::VectorXd step = geometry::solve_spd(both.information, both.gradient).solution;
  Eigen::Matrix3d strain;
  const auto e = step.tail<6>();
  strain << e[0], e[3] / 2, e[4] / 2, e[3] / 2, e[1], e[5] / 2, e[4] / 2, e[5] / 2, e[2];
  const auto principal = geometry::symmetric_eigen(strain);
  Eigen::Index largest = 0;
  principal.values.cwiseAbs().maxCoeff(&largest);
  const Vector3d a = principal.vectors.col(largest);
  Eigen::Matrix<double, 6, 1> along;
  along << a[0] * a[0], a[1] * a[1], a[2] * a[2], a[0] * a[1], a[0] * a[2], a[1] * a[2];
  const MatrixXd covariance = errors.covariance(observation, centre, problem, both);
  // A shift common to a view's edges is no strain; one of some of them is.
  const double floor = errors.edge.shift_mm / errors.radius_mm;
  return {
      principal.values[largest],
      std::hypot(std::sqrt(std::max(0.0, along.dot(covariance.bottomRightCorner<6, 6>() * along))), floor)};
}

/// The views' own solutions against their errors. Cameras without covariance explain more.
template <class Refuse, class Warn>
void check_chi_square(const Model& model, const RegistrationOptions& options, const Registration& result,
                      const Refuse& refuse, const Warn& warn) {
  if (!result.disagreement || result.disagreement->ratio() <= most_disagreement_ratio) return;
  const Disagreement& apart = *result.disagreement;
  const std::string message = fmt::format(
      "{}: the views' own solutions differ by more than their errors (chi-square {:.0f} for {} degrees of "
      "freedom): the body moved between the acquisitions, also along a view's rays, or has another size, or "
      "the cameras are less exact than stated",
      model.name, apart.chi2, apart.dof);
  const std::map<std::string, double> figures = {{"chi2", apart.chi2}, {"dof", double(apart.dof)}};
  const bool exact = options.camera_covariance.size() == 0;
  if (apart.ratio() > (exact ? refused_ratio_exact : refused_ratio))
    refuse(Reason::registration_disagrees, message, figures);
  else
    warn(Reason::registration_disagrees,
         message + fmt::format("; the covariance is inflated by {:.1f}", apart.ratio()), figures);
}

/// The agreement of a few edges is chance.
template <class Refuse>
void check_determined(const Model& model, bool has_start, Registration& result, const Refuse& refuse) {
  const int least = model.surface ? least_contour_points : least_patches;
  for (const RegisteredView& view : result.views)
    if (view.comparisons < least)
      refuse(Reason::wrong_model,
             fmt::format(
                 "{}: {} of its edges can be compared with {}, at least {} are required: {}it is hidden or "
                 "smaller than its file says (unit){}",
                 model.name, view.comparisons, view.name, least,
                 has_start ? "its start is outside the image, " : "",
                 model.surface ? "" : ", or the volume's values are no Hounsfield units"),
             {{"comparisons", double(view.comparisons)}, {"limit", double(least)}});
  if (result.is_determined() && geometry::whitening(result.covariance)) return;
  result.covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
  refuse(Reason::uncertain, model.name + ": the images do not determine its pose", {});
}

/// What may help a search that ended wrongly, where it may have missed the solution; or nothing.
std::string wider_search(const RegistrationOptions& options, const Registration& result, double nearest_mm,
                         double reach_mm) {
  constexpr double edge_share = 0.6;
  const bool at_edge = nearest_mm > edge_share * reach_mm, disagree = result.starts > 1 && result.agree < 2;
  if (result.anywhere)
    return "; every orientation and position was searched: if the model is right, give landmarks or a pose";
  if (options.search.candidates == 0 || !(at_edge || disagree)) return "";
  return fmt::format(
      "; {}: if the model is right, search wider (--search-mm {:g} --search-deg {:g}) or start nearer, with "
      "landmarks",
      at_edge ? fmt::format("this solution lies {:.1f} mm from the start, where the search of {:.1f} mm ends",
                            nearest_mm, reach_mm)
              : fmt::format("only one of {} starts ended here", result.starts),
      std::min(most_search_mm, 2 * options.search.shift_mm),
      std::min(most_search_deg, 2 * options.search.turn_deg));
}

void decide(const Model& model, const std::vector<geometry::RigidTransform>& starts,
            const RegistrationOptions& options, Registration& result) {
  const auto refuse = [&](Reason reason, const std::string& message, std::map<std::string, double> figures) {
    if (!result.failure) result.failure = Failure{reason, message, {}, std::move(figures)};
  };
  const auto warn = [&](Reason reason, const std::string& message, std::map<std::string, double> figures) {
    result.warnings.push_back({reason, message, {}, std::move(figures)});
  };
  check_determined(model, !starts.empty(), result, refuse);
  double nearest = 1e9;
  for (const geometry::RigidTransform& start : starts)
    nearest = std::min(nearest, separation(model, start, result.world_from_model));
  const double reach = std::hypot(std::sqrt(3.0) * options.search.shift_mm,
                                  1.5 * model.radius_mm * options.search.turn_deg * EIGEN_PI / 180);
  const std::string wider = wider_search(options, result, nearest, reach);
  const bool is_mirrored = result.mirrored_ratio && *result.mirrored_ratio < clearly_mirrored_ratio;
  const std::string mirrored =
      is_mirrored ? fmt::format(
                        "; its mirror image fits better (cost ratio {:.2f}): left and right may be "
                        "exchanged, or slices or an axis reversed",
                        *result.mirrored_ratio)
                  : "";
  const double least = model.surface ? least_contour_score : least_patch_score;
  for (const RegisteredView& view : result.views)
    if (view.score < least)
      refuse(Reason::wrong_model,
             fmt::format(
                 "{}: the model explains {:.3g} of its edges in {}, at least {:.2g} are required: another "
                 "bone, patient or unit, exchanged cameras or images, a start too far away, or the model is "
                 "hidden{}{}",
                 model.name, view.score, view.name, least, mirrored, wider),
             {{"score", view.score}, {"limit", least}});
  if (!starts.empty() && nearest > reach)
    refuse(
        Reason::out_of_capture,
        fmt::format(
            "{}: the solution is {:.1f} mm from the nearest start, beyond the {:.1f} mm that were searched{}",
            model.name, nearest, reach, wider),
        {{"distance_mm", nearest}, {"limit_mm", reach}});
  if (result.mirrored_ratio && *result.mirrored_ratio < least_mirrored_ratio)
    refuse(Reason::wrong_model,
           fmt::format(
               "{}: the mirror image of the model fits {} (cost ratio {:.2f}, at least {:.2f} is required): "
               "left and right may be exchanged, or slices or an axis reversed",
               model.name, *result.mirrored_ratio < 1 ? "better" : "almost as well", *result.mirrored_ratio,
               least_mirrored_ratio),
           {{"mirrored_ratio", *result.mirrored_ratio}, {"limit", least_mirrored_ratio}});
  if (result.runner_up && result.runner_up->cost_ratio < least_runner_up_ratio)
    refuse(Reason::registration_ambiguous,
           fmt::format(
               "{}: another pose, {:.1f} mm away, explains the images almost as well (cost ratio {:.2f}, at "
               "least {:.2f} is required); {}",
               model.name, result.runner_up->distance_mm, result.runner_up->cost_ratio, least_runner_up_ratio,
               result.anywhere ? "choose one of the report's poses and give it as \"start\", or landmarks"
                               : "give a start nearer to the truth, or landmarks"),
           {{"distance_mm", result.runner_up->distance_mm}, {"cost_ratio", result.runner_up->cost_ratio}});
  const Deformation& shape = result.deformation;
  const double strain_limit = result.views.size() > 1 ? most_strain : most_strain_of_one_view;
  if (std::abs(shape.strain) > strain_limit && std::abs(shape.strain) > strain_sigmas * shape.sigma)
    refuse(Reason::wrong_model,
           fmt::format("{}: the images ask for a model {:.1f} % {} along one direction (sigma {:.1f} %, at "
                       "most {:.1f} % are allowed): another patient's, or its voxel size or unit is wrong",
                       model.name, 100 * std::abs(shape.strain), shape.strain > 0 ? "larger" : "smaller",
                       100 * shape.sigma, 100 * strain_limit),
           {{"strain", shape.strain}, {"sigma", shape.sigma}, {"limit", strain_limit}});
  else if (result.views.size() > 1 && std::abs(shape.strain) > doubtful_strain &&
           std::abs(shape.strain) > strain_sigmas * shape.sigma)
    warn(Reason::scale_disagrees,
         fmt::format("{}: the images ask for a model {:.1f} % {} along one direction (sigma {:.1f} %): check "
                     "its voxel size, also the distance of the slices, and that it is this patient's",
                     model.name, 100 * std::abs(shape.strain), shape.strain > 0 ? "larger" : "smaller",
                     100 * shape.sigma),
         {{"strain", shape.strain}, {"sigma", shape.sigma}, {"limit", doubtful_strain}});
  if (result.disagreement && result.disagreement->distance_mm > most_disagreement_mm &&
      result.disagreement->distance_mm > disagreement_sigmas * result.disagreement->sigma_mm)
    refuse(Reason::registration_disagrees,
           fmt::format(
               "{}: the views contradict each other by {:.2f} mm along the direction that both see (sigma "
               "{:.2f} mm): the body moved between the acquisitions, or a calibration is wrong",
               model.name, result.disagreement->distance_mm, result.disagreement->sigma_mm),
           {{"distance_mm", result.disagreement->distance_mm}, {"sigma_mm", result.disagreement->sigma_mm}});
  check_chi_square(model, options, result, refuse, warn);
  const double worst = result.is_determined() ? worst_error_mm(model, result) : 0;
  if (worst > options.max_error_mm.value_or(usual_error_mm)) {
    const std::string message =
        fmt::format("{}: a point of the model may be off by {:.2f} mm (95 %), limit {:g} mm{}", model.name,
                    worst, options.max_error_mm.value_or(usual_error_mm),
                    result.views.size() < 2 ? "; one view hardly sees the depth: take a second one" : "");
    if (options.max_error_mm)
      refuse(Reason::uncertain, message, {{"error_mm", worst}, {"limit_mm", *options.max_error_mm}});
    else
      warn(Reason::uncertain, message, {{"error_mm", worst}, {"limit_mm", usual_error_mm}});
  }
  if (!result.failure && result.agree < 2)
    warn(Reason::out_of_capture,
         fmt::format(
             "{}: one of {} starts ended here; give a start nearer to the truth for a second confirmation",
             model.name, result.starts),
         {{"agree", double(result.agree)}, {"starts", double(result.starts)}});
  result.decision = result.failure            ? Decision::refuse
                    : result.warnings.empty() ? Decision::accept
                                              : Decision::warn;
}

bool may_have_missed(const Registration& result) {
  return result.failure &&
         (result.failure->reason == Reason::wrong_model || result.failure->reason == Reason::out_of_capture ||
          result.failure->reason == Reason::registration_ambiguous);
}

bool is_confirmed(const Model& model, const Registration& result) {
  if (result.failure) return false;
  const auto is_clear = [](const RegisteredView& view) { return view.score >= clear_patch_score; };
  // Of more starts more end by chance where another does.
  const int enough = std::max(2, result.starts / 128);
  return result.agree >= enough || (!model.surface && std::ranges::all_of(result.views, is_clear));
}

}  // namespace helicarm::registration
