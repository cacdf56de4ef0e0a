// SPDX-License-Identifier: Apache-2.0
#include "studies/design.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include <fmt/format.h>

#include "helicarm/core/random.h"
#include "helicarm/phantom/conical_helix.h"
#include "helicarm/phantom/rules.h"
#include "studies/statistics.h"

namespace helicarm::study {
namespace {

constexpr std::size_t sets_of_block = 64;
constexpr std::uint64_t search_draws = 256, report_draws = 8192;
constexpr double least_spacing_mm = 5;  // two 4 mm balls and a wall between them
constexpr double design_ball_mm = 4;    // 2.3.4

/// Two parameters in (0, 1) for each ball: along the surface's axis or the spiral, and around it.
using Shares = std::vector<double>;

Eigen::Vector3d place_on(DesignSurface surface, double share, double around) {
  constexpr double margin = design_ball_mm / 2 / cone_height_mm;  // no ball protrudes at the base or the top
  const double along = margin + (1 - 2 * margin) * share;
  const double angle = 2 * std::numbers::pi * around, z = along * cone_height_mm;
  switch (surface) {
    case DesignSurface::helix:
      return phantom::ConicalHelix().point(along * phantom::ConicalHelix().t_end);
    case DesignSurface::cone: {
      const double radius = cone_base_mm + along * (cone_top_mm - cone_base_mm);
      return {radius * std::cos(angle), radius * std::sin(angle), z};
    }
    case DesignSurface::dome: {
      const double radius = cone_base_mm * std::sqrt(1 - along * along);
      return {radius * std::cos(angle), radius * std::sin(angle), z};
    }
  }
  return Eigen::Vector3d::Zero();
}

std::vector<Eigen::Vector3d> places_of(DesignSurface surface, const Shares& shares) {
  std::vector<Eigen::Vector3d> places;
  for (std::size_t i = 0; i < shares.size(); i += 2)
    places.push_back(place_on(surface, shares[i], shares[i + 1]));
  return places;
}

/// Labels from the base upwards; not P1 to P12, which have rules by label.
phantom::Calibrator calibrator_of(std::string name, std::vector<Eigen::Vector3d> places) {
  std::ranges::sort(places, {}, [](const Eigen::Vector3d& p) { return p.z(); });
  phantom::Calibrator calibrator{std::move(name), {}, {}};
  for (const auto& position : places)
    calibrator.balls.push_back({fmt::format("B{}", calibrator.balls.size() + 1), position, design_ball_mm});
  return calibrator;
}

bool well_apart(const phantom::Calibrator& calibrator) {
  for (std::size_t i = 0; i < calibrator.balls.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if ((calibrator.balls[i].centre_in_calibrator - calibrator.balls[j].centre_in_calibrator).norm() <
          least_spacing_mm)
        return false;
  return true;
}

bool keeps_rules(const phantom::Calibrator& calibrator) {
  return well_apart(calibrator) &&
         std::ranges::all_of(phantom::check_rules(calibrator),
                             [](const phantom::RuleFinding& finding) { return finding.passed(); });
}

/// Predicts TRE from simulated noise: all sets share the same draws, so that two sets differ only by their
/// balls.
class Judge {
 public:
  Judge(const DesignOptions& options, std::uint32_t stream, std::uint64_t draws)
      : sigma_(sigma_px(options.sigma, options.fle)),
        targets_(targets_in_cone()),
        lane_targets_(targets_, views_) {
    for (std::uint64_t first = 0; first < draws; first += simd_width) {
      noise_.emplace_back();
      draw_noise(SimdRandom(options.seed, stream, first), draw::calibration, SimdBalls::most, noise_.back());
    }
  }

  double tre_mm(const std::vector<Eigen::Vector3d>& places) const {
    const std::size_t count = places.size();
    std::vector<SimdPoint> balls;
    SimdPixels exact, pixels;
    for (const auto& position : places) {
      balls.push_back({simd(position.x()), simd(position.y()), simd(position.z())});
      for (std::size_t view = 0; view < 2; ++view)
        exact.of_view[view][balls.size() - 1] = lane_views_.project(view, balls.back());
    }
    const SimdBalls model(balls);
    Simd sum{};
    for (const SimdPixels& noise : noise_) {
      add_noise(exact, sigma_, noise, count, pixels);
      const SimdProjection calibrated[2] = {model.calibrate({pixels.of_view[0], count}),
                                            model.calibrate({pixels.of_view[1], count})};
      sum += lane_targets_.mean_square(0, lane_targets_.size(), calibrated);
    }
    const double mean = (sum[0] + sum[1] + sum[2] + sum[3]) / double(simd_width * noise_.size());
    return std::isfinite(mean) ? std::sqrt(mean) : std::numeric_limits<double>::infinity();
  }

 private:
  double sigma_;
  std::array<geometry::View, 2> views_ = paper_views(WorldOrigin::centre);
  SimdViews lane_views_{views_};
  std::vector<Eigen::Vector3d> targets_;
  SimdTargets lane_targets_;
  std::vector<SimdPixels> noise_;
};

Shares random_shares(const DesignOptions& options, std::uint32_t stream, std::uint64_t trial) {
  RandomStream random(options.seed, stream, trial);
  Shares shares(2 * std::size_t(options.balls));
  for (double& share : shares) share = random.uniform();
  return shares;
}

double reflected(double share) {
  share = std::abs(share);
  return share > 1 ? std::max(0.0, 2 - share) : share;
}

/// Result of one restart: the TRE, infinity if it never kept the rules; then the parameters.
std::vector<double> search(const DesignOptions& options, const Judge& judge, std::size_t restart) {
  RandomStream random(options.seed, design_stream + 2, restart);
  Shares now;
  std::vector<Eigen::Vector3d> places;
  // Equally spaced with a random rotation: keeps the rules more often than a random start.
  for (int attempt = 0; attempt < 200; ++attempt) {
    now.clear();
    const double turn = random.uniform(), step = random.uniform();
    for (int i = 0; i < options.balls; ++i) {
      now.push_back((i + 0.1 + 0.8 * random.uniform()) / options.balls);
      now.push_back(std::fmod(turn + i * step, 1.0));
    }
    places = places_of(options.surface, now);
    if (keeps_rules(calibrator_of("start", places))) break;
    places.clear();
  }
  double best = places.empty() ? std::numeric_limits<double>::infinity() : judge.tre_mm(places);
  for (int k = 0; k < options.steps && !places.empty(); ++k) {
    Shares next = now;
    const double reach = 0.3 * std::pow(0.02, double(k) / options.steps);
    const std::size_t ball = 2 * std::size_t(random.index(std::uint32_t(options.balls)));
    next[ball] = reflected(next[ball] + reach * random.normal());
    next[ball + 1] += reach * random.normal();
    next[ball + 1] -= std::floor(next[ball + 1]);
    const auto moved = places_of(options.surface, next);
    const double tre = judge.tre_mm(moved);
    if (tre < best && keeps_rules(calibrator_of("next", moved))) now = next, best = tre;
  }
  std::vector<double> answer{best};
  answer.insert(answer.end(), now.begin(), now.end());
  return answer;
}

}  // namespace

std::string_view name_of(DesignSurface surface) {
  constexpr std::array names{"helix", "cone", "dome"};
  return names[std::size_t(surface)];
}

Expected<DesignAnswer> study_design(const DesignOptions& options, const EngineOptions& engine,
                                    const Ranks& ranks) {
  if (options.balls < 6 || options.balls > 20)
    return fail(Reason::bad_value, fmt::format("balls: {}, limits 6 and 20", options.balls));
  if (options.groups < 1 || options.restarts < 1)
    return fail(Reason::bad_value, "groups: 0, at least 1 is required");
  const Judge judge(options, design_stream, search_draws);
  const std::size_t size = 1 + 2 * std::size_t(options.balls);

  StudySetting random;
  random.blocks = (options.groups + sets_of_block - 1) / sets_of_block;
  random.values_per_block = sets_of_block;
  random.work = [&](std::size_t block, std::span<double> values) {
    for (std::size_t i = 0; i < values.size() && block * sets_of_block + i < options.groups; ++i)
      values[i] = judge.tre_mm(
          places_of(options.surface, random_shares(options, design_stream + 1, block * sets_of_block + i)));
  };
  random.cost = double(options.groups);

  StudySetting restarts;
  restarts.blocks = std::size_t(options.restarts);
  restarts.values_per_block = size;
  restarts.cost = 2.0 * options.restarts * options.steps;
  restarts.work = [&](std::size_t block, std::span<double> values) {
    std::ranges::copy(search(options, judge, block), values.begin());
  };
  restarts.settle = [&](std::span<const double> values) {
    std::size_t best = 0;
    for (std::size_t i = 0; i < values.size(); i += size)
      if (values[i] < values[best]) best = i;
    const auto from = values.begin() + std::ptrdiff_t(best);
    return std::vector<double>(from, from + std::ptrdiff_t(size));
  };
  const std::string identity =
      fmt::format("design {} groups {} seed {} balls {} surface {} sigma {} fle {} search {} {}",
                  HELICARM_VERSION, options.groups, options.seed, options.balls, name_of(options.surface),
                  name_of(options.sigma), options.fle, options.restarts, options.steps);
  const auto kept = run_study({random, restarts}, identity, engine, ranks);
  if (!kept) return tl::unexpected<Failure>(kept.error());
  DesignAnswer answer;
  if (kept->empty()) return answer;

  const Judge reporter(options, design_stream + 3, report_draws);
  const auto judged = [&](phantom::Calibrator calibrator) {
    std::vector<Eigen::Vector3d> places;
    for (const phantom::CalibratorBall& ball : calibrator.balls) places.push_back(ball.centre_in_calibrator);
    const bool kept_rules = keeps_rules(calibrator);
    return DesignedSet{std::move(calibrator), reporter.tre_mm(places), kept_rules};
  };
  const std::vector<double>& found = kept->back();
  if (!std::isfinite(found[0]))
    return fail(
        Reason::uncertain,
        fmt::format(
            "no set of {} balls on the {} that keeps the rules was found: allow more restarts or fewer balls",
            options.balls, name_of(options.surface)));
  answer.design =
      judged(calibrator_of("design", places_of(options.surface, Shares(found.begin() + 1, found.end()))));
  answer.udcsc = judged(phantom::udcsc());
  const std::span<const double> tre = std::span(kept->front()).first(options.groups);
  answer.median_random_mm = column_statistics(tre).median;
  std::vector<std::size_t> order(tre.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return tre[i]; });
  const auto random_set = [&](std::size_t i) {
    return calibrator_of("random", places_of(options.surface, random_shares(options, design_stream + 1, i)));
  };
  answer.best_random = judged(random_set(order[0]));
  for (std::size_t i = 0; i < std::min(tried_random_sets, order.size()); ++i)
    if (const phantom::Calibrator set = random_set(order[i]); keeps_rules(set)) {
      answer.best_random_ruled = judged(set);
      break;
    }
  return answer;
}

}  // namespace helicarm::study
