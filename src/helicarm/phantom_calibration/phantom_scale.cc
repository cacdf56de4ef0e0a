// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/phantom_scale.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/phantom_calibration/diameter_scale.h"
#include "helicarm/phantom_calibration/gauge.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::Vector3d;

constexpr const char* diameter_words = "the diameters of the balls' images";
constexpr double clearly_better_chi2 = 9;
constexpr double stated_diameter_sigma = 0.03;  // of a scale by the diameters alone; as LabellingPrior's
constexpr const char* nominal_words = "the nominal file";

Expected<std::size_t> fiducial_named(const FiducialName& name, const AdjustedViews& found) {
  if (const auto* label = std::get_if<std::string>(&name)) {
    const auto at = std::ranges::find(found.labels, *label);
    if (at != found.labels.end()) return std::size_t(at - found.labels.begin());
    return fail(Reason::bad_value, fmt::format("distance: \"{}\" is not one of the measured balls", *label));
  }
  constexpr double reach_px = 20;
  const auto& place = std::get<Eigen::Vector2d>(name);
  double nearest = reach_px;
  std::optional<std::size_t> which;
  for (std::size_t v = 0; v < found.view_of_case.size(); ++v) {
    if (found.view_of_case[v] != 0) continue;
    for (std::size_t i = 0; i < found.observed[v].size(); ++i)
      if (const auto& seen = found.observed[v][i]; seen && (seen->uv_raw - place).norm() < nearest) {
        nearest = (seen->uv_raw - place).norm();
        which = i;
      }
  }
  if (which) return *which;
  return fail(Reason::bad_value,
              fmt::format("distance: no ball within {:g} px of {:g},{:g} in the first view", reach_px,
                          place.x(), place.y()));
}

const char* kind_word(bool outer) { return outer ? "outer distances" : "distances of the centres"; }

/// Scales by the distances as stated, and read as the other kind; failures where they contradict each other.
struct ByHand {
  Expected<ScaledPoints> stated, otherwise;
};

ByHand by_hand(const AdjustedViews& found, const Eigen::MatrixXd& covariance_mm2,
               const std::vector<CentreDistance>& distances, const PhantomOptions& options) {
  const auto& centres = found.consistent.fit.centres;
  const auto other = distances_of(found, options, !options.outer);
  return {scaled_by(centres, covariance_mm2, distances, found.labels),
          other ? scaled_by(centres, covariance_mm2, *other, found.labels) : tl::unexpected(other.error())};
}

/// Lengths of `points` over those of the fit.
double factor_of(const ScaledPoints& points, const AdjustedViews& found, const PairToMeasure& pair) {
  const auto& centres = found.consistent.fit.centres;
  return (points.centres[pair.a] - points.centres[pair.b]).norm() /
         (centres[pair.a] - centres[pair.b]).norm();
}

/// Distances that only the other kind explains, or explains clearly better.
Expected<void> check_kind(const ByHand& scales, double ratio, const PhantomOptions& options,
                          PhantomResult& result) {
  const std::string advice =
      fmt::format("taken as {} they agree: check --distance-is (distance_is)", kind_word(!options.outer));
  if (!scales.stated) {
    Failure failure = scales.stated.error();
    if (failure.reason == Reason::distances_disagree && scales.otherwise) failure.message += "; " + advice;
    return tl::unexpected<Failure>(std::move(failure));
  }
  if (!scales.otherwise || scales.stated->chi2 - scales.otherwise->chi2 < clearly_better_chi2) return {};
  result.warnings.push_back(
      {Reason::distances_disagree,
       fmt::format(
           "as {} the distances agree less well (chi-square {:.3g}) than as {} ({:.3g}), which make the "
           "phantom {:.4g} times as large: check --distance-is (distance_is)",
           kind_word(options.outer), scales.stated->chi2, kind_word(!options.outer), scales.otherwise->chi2,
           ratio),
       {},
       {{"chi2", scales.stated->chi2}, {"chi2_otherwise", scales.otherwise->chi2}, {"ratio", ratio}}});
  return {};
}

/// Whether the distances contradict each other if they are read as the other kind.
bool is_kind_confirmed(const ByHand& scales) {
  return scales.stated &&
         (!scales.otherwise || scales.otherwise->chi2 - scales.stated->chi2 > clearly_better_chi2);
}

/// The scale of the nominal file, which is wrong by the printer's shrinkage and by the deviations of the
/// balls: its lengths over those of `centres`, and its relative error.
DiameterScale nominal_scale(const std::vector<Vector3d>& centres, const AdjustedViews& found,
                            const phantom::Calibrator& nominal) {
  const double shrinkage_sigma = std::hypot(0.005, nominal.scale_sigma);
  std::vector<Vector3d> places;
  for (const std::size_t ball : found.ball_of_nominal)
    places.push_back(nominal.balls[ball].centre_in_calibrator);
  const RobustFit fit = robust_similarity(centres, places, true);
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& place : places) mean += place / double(places.size());
  double deviation = 0, extent = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    deviation += fit.weights[Eigen::Index(i)] * (fit.a_from_b * centres[i] - places[i]).squaredNorm();
    extent += fit.weights[Eigen::Index(i)] * (places[i] - mean).squaredNorm();
  }
  const double per_axis = std::sqrt(deviation / (3 * fit.weights.sum()));
  return {fit.a_from_b.scale, std::hypot(shrinkage_sigma, per_axis / std::sqrt(extent))};
}

Expected<void> check_depth(double factor, double sigma, const DepthLimits& limits) {
  constexpr double margin = 1.05;  // of the stated source distance
  if (factor * (1 - 3 * sigma) <= margin * limits.largest_factor) return {};
  const double ratio = factor / limits.largest_factor;
  return fail(
      Reason::scale_disagrees,
      fmt::format("at this scale (sigma {:.2g} %) a ball lies {:.3g} times as far from the source as the "
                  "receiver: the stated diameters, distances or their unit are wrong, or the source "
                  "distance of the images is",
                  100 * sigma, ratio),
      {{"ratio", ratio}, {"relative_sigma", sigma}});
}

ScaleAgreement agreement(const ScaleComparison& comparison) { return {comparison.ratio, comparison.sigma}; }

/// Distances of which none is confirmed by another: what would not show.
Warning unchecked(std::size_t distances, const PhantomResult& result) {
  std::string by;
  double least = 1e300;
  const auto add = [&](const char* name, const std::optional<ScaleAgreement>& with) {
    if (!with) return;
    by += fmt::format("{}{} ({:.4g} times theirs, sigma {:.2g} %)", by.empty() ? "" : " and ", name,
                      with->ratio, 100 * with->sigma);
    least = std::min(least, with->sigma);
  };
  add(diameter_words, result.scale.over_diameters);
  add(nominal_words, result.scale.over_nominal);
  return {Reason::scale_unverified,
          fmt::format("no distance of clearly another length checks the scale, neither its value nor "
                      "--distance-is: it is "
                      "compared with {} only; an error below {:.2g} % of it, and of all lengths, does not "
                      "show. Measure a second one, of "
                      "clearly another length",
                      by, 300 * least),
          {},
          {{"error_that_does_not_show", 3 * least}, {"distances", double(distances)}}};
}

}  // namespace

Expected<std::vector<CentreDistance>> distances_of(const AdjustedViews& found, const PhantomOptions& options,
                                                   bool outer) {
  std::vector<CentreDistance> distances;
  for (const HandDistance& distance : options.distances) {
    const auto a = fiducial_named(distance.a, found);
    const auto b = fiducial_named(distance.b, found);
    if (!a) return tl::unexpected<Failure>(a.error());
    if (!b) return tl::unexpected<Failure>(b.error());
    const double over = outer ? (found.diameters_mm[*a] + found.diameters_mm[*b]) / 2 : 0;
    if (*a == *b || !(distance.mm - over > 0))
      return fail(
          Reason::bad_value,
          fmt::format("distance: {:g} mm cannot be the distance of two different balls", distance.mm));
    distances.push_back({*a, *b, distance.mm - over, options.distance_sigma_mm});
  }
  return distances;
}

std::optional<double> factor_by_hand(const AdjustedViews& found, const PhantomOptions& options) {
  const auto distances = distances_of(found, options, options.outer);
  if (!distances || distances->empty()) return std::nullopt;
  double measured = 0, fitted = 0;
  for (const CentreDistance& d : *distances) {
    measured += d.mm;
    fitted += (found.consistent.fit.centres[d.a] - found.consistent.fit.centres[d.b]).norm();
  }
  return measured / fitted;
}

Expected<ScaledPoints> scaled(const AdjustedViews& found,
                              const std::vector<pipeline::RectifiedView>& detected,
                              const Eigen::MatrixXd& covariance_mm2, const PhantomOptions& options,
                              PhantomResult& result) {
  const auto& centres = found.consistent.fit.centres;
  const auto distances = distances_of(found, options, options.outer);
  if (!distances) return tl::unexpected<Failure>(distances.error());
  const DiameterScale diameters = diameter_scale(found);
  const double by_diameters_sigma = std::max(stated_diameter_sigma, diameters.sigma);
  ScaledPoints points = scaled_by(centres, covariance_mm2, diameters.factor, by_diameters_sigma);
  result.scale = {"diameters", by_diameters_sigma, {}, {}};
  result.pair = best_pair(points.centres, diameters.factor * diameters.factor * covariance_mm2,
                          options.distance_sigma_mm);
  double factor = diameters.factor;
  std::optional<double> other_factor;
  std::string words = diameter_words;
  double contradiction = 0;
  bool confirmed = false;
  if (!distances->empty()) {
    const ByHand scales = by_hand(found, covariance_mm2, *distances, options);
    if (scales.stated) points = *scales.stated, factor = factor_of(points, found, result.pair);
    if (scales.otherwise) other_factor = factor_of(*scales.otherwise, found, result.pair);
    const double ratio = other_factor.value_or(factor) / factor;
    const std::size_t before = result.warnings.size();
    if (auto kind = check_kind(scales, ratio, options, result); !kind)
      return tl::unexpected<Failure>(kind.error());
    if (result.warnings.size() > before) contradiction = std::abs(ratio - 1);
    confirmed = distances->size() > 1 && is_kind_confirmed(scales);
    result.scale = {"distances", points.scale_sigma, {}, {}};
    result.pair.distance_mm = (points.centres[result.pair.a] - points.centres[result.pair.b]).norm();
    words = "the distances measured by hand";
  }
  const double compared_sigma = distances->empty() ? diameters.sigma : points.scale_sigma;
  const std::string correction = fmt::format("taken as {}", kind_word(!options.outer));
  const auto compared = [&](const std::string& other, double other_scale, double sigma) {
    ScaleComparison comparison{words, other, factor / other_scale, sigma, correction, {}};
    if (other_factor) comparison.corrected_ratio = *other_factor / other_scale;
    return comparison;
  };
  std::vector<ScaleComparison> comparisons;
  if (result.nominal) {
    const DiameterScale nominal = nominal_scale(points.centres, found, *result.nominal);
    comparisons.push_back(
        compared(nominal_words, nominal.factor * factor, std::hypot(nominal.sigma, compared_sigma)));
    result.scale.over_nominal = agreement(comparisons.back());
  }
  if (!distances->empty()) {
    comparisons.push_back(
        compared(diameter_words, diameters.factor, std::hypot(diameters.sigma, compared_sigma)));
    result.scale.over_diameters = agreement(comparisons.back());
  }
  const DepthLimits limits = depth_limits(found, detected);
  if (limits.by_tag)
    comparisons.push_back(compared("Distance Source to Patient (0018,1111) of the images",
                                   limits.by_tag->factor, std::hypot(limits.by_tag->sigma, compared_sigma)));
  for (const ScaleComparison& comparison : comparisons) {
    if (auto checked = check_scale(comparison, result.warnings); !checked)
      return tl::unexpected<Failure>(checked.error());
    // Distances that confirm each other know better than the design.
    if (is_contradiction(comparison) && !(confirmed && comparison.other == nominal_words))
      contradiction = std::max(contradiction, std::abs(comparison.ratio - 1));
  }
  if (auto within = check_depth(factor, points.scale_sigma, limits); !within)
    return tl::unexpected<Failure>(within.error());
  points = with_scale_error(std::move(points), contradiction);
  result.scale.relative_sigma = points.scale_sigma;
  if (!distances->empty() && !confirmed) result.notes.push_back(unchecked(distances->size(), result));
  if (!distances->empty()) return points;
  result.warnings.push_back({Reason::scale_weak,
                             fmt::format("the scale is estimated from the diameters of the balls' images, "
                                         "taken as stated, with a sigma of {:.2g} "
                                         "%: measure {} to {} (about {:.1f} mm) and give this distance",
                                         100 * result.scale.relative_sigma, found.labels[result.pair.a],
                                         found.labels[result.pair.b], result.pair.distance_mm),
                             {},
                             {{"relative_sigma", result.scale.relative_sigma}}});
  return points;
}

}  // namespace helicarm::phantom_calibration
