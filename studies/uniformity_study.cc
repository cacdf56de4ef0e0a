// SPDX-License-Identifier: Apache-2.0
#include "studies/uniformity_study.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "helicarm/phantom/uniformity.h"
#include "helicarm/report/chart.h"
#include "studies/records.h"
#include "studies/statistics.h"

namespace helicarm::study {
namespace {

constexpr std::size_t groups_of_turn = 32;  // per block; E(A) is slow
constexpr double printed_pearson = 0.4224;
constexpr std::size_t figures_of_group = numbers_in<UniformityGroup>;

constexpr std::array<const char*, figures_of_group> figure_names{"uniformity",
                                                                 "tre_ball_fresh_noise",
                                                                 "tre_cone_fresh_noise",
                                                                 "tre_centre_fresh_noise",
                                                                 "tre_ball_exact",
                                                                 "tre_cone_exact",
                                                                 "tre_centre_exact",
                                                                 "mean_tre_ball_fresh_noise",
                                                                 "mean_tre_cone_fresh_noise",
                                                                 "mean_tre_centre_fresh_noise",
                                                                 "mean_tre_ball_exact",
                                                                 "mean_tre_cone_exact",
                                                                 "mean_tre_centre_exact"};

struct UniformityTrials {
  UniformityOptions options;
  std::array<geometry::View, 2> views = paper_views(options.origin);
  SimdViews lane_views{views};
  std::array<SimdTargets, 3> places{SimdTargets(targets_in_ball(options.origin), views),
                                    SimdTargets(targets_in_cone(), views),
                                    SimdTargets(std::array{middle_of_cone()}, views)};

  /// Groups first .. first + 3, figures_of_group values each.
  void run(std::uint64_t first_group, double* out) const {
    const auto count = std::size_t(options.balls);
    const double sigma = sigma_px(options.sigma, options.fle);
    const SimdRandom random(options.seed, uniformity_stream, first_group);
    const std::vector<SimdPoint> balls = balls_on_spiral(random, count);
    SimdPixels exact, noise, pixels;
    for (std::size_t view = 0; view < 2; ++view)
      for (std::size_t i = 0; i < count; ++i) exact.of_view[view][i] = lane_views.project(view, balls[i]);
    const SimdBalls model(balls);
    Simd first[6]{}, sum[6]{};
    for (int k = 0; k < options.draws; ++k) {
      const std::uint32_t at = draw::repetition * std::uint32_t(k);
      draw_noise(random, at + draw::calibration, count, noise);
      add_noise(exact, sigma, noise, count, pixels);
      const SimdProjection calibrated[2] = {model.calibrate({pixels.of_view[0], count}),
                                            model.calibrate({pixels.of_view[1], count})};
      std::uint32_t from = draw::targets;
      for (std::size_t place = 0; place < 3; ++place) {
        const SimdTargets& targets = places[place];
        draw_noise(random, at + from, targets.size(), noise);
        from += 2 * SimdBalls::most;
        const Simd fresh = targets.mean_error(0, targets.size(), calibrated, sigma, &noise);
        const Simd bare = targets.mean_error(0, targets.size(), calibrated, sigma, nullptr);
        if (k == 0) first[place] = fresh, first[3 + place] = bare;
        sum[place] += fresh;
        sum[3 + place] += bare;
      }
    }
    const phantom::SurgicalSpace space{origin_in_calibrator(options.origin), space_radius_mm};
    for (int lane = 0; lane < simd_width; ++lane, out += figures_of_group) {
      std::vector<Eigen::Vector3d> points;
      for (const SimdPoint& ball : balls) points.emplace_back(ball.x[lane], ball.y[lane], ball.z[lane]);
      out[0] = phantom::uniformity(points, space);
      for (std::size_t i = 0; i < 6; ++i) {
        out[1 + i] = first[i][lane];
        out[7 + i] = sum[i][lane] / options.draws;
      }
    }
  }
};

std::vector<double> figure_of(const std::vector<UniformityGroup>& groups, std::size_t figure) {
  std::vector<double> column;
  for (const UniformityGroup& group : groups) column.push_back(numbers_of(group)[figure]);
  return column;
}

}  // namespace

Expected<std::vector<UniformityGroup>> study_uniformity(const UniformityOptions& options,
                                                        const EngineOptions& engine, const Ranks& ranks) {
  if (options.balls < 6 || options.balls > int(SimdBalls::most))
    return fail(Reason::bad_value, fmt::format("balls: {}, limits 6 and {}", options.balls, SimdBalls::most));
  if (options.groups < 3)
    return fail(Reason::bad_value, fmt::format("groups: {}, at least 3 are required", options.groups));
  if (options.draws < 1)
    return fail(Reason::bad_value, fmt::format("draws: {}, at least 1 is required", options.draws));
  const UniformityTrials trials{options};
  StudySetting setting;
  setting.blocks = (options.groups + groups_of_turn - 1) / groups_of_turn;
  setting.values_per_block = groups_of_turn * figures_of_group;
  setting.work = [&](std::size_t block, std::span<double> values) {
    for (std::size_t i = 0; i < groups_of_turn; i += simd_width)
      if (const std::size_t group = block * groups_of_turn + i; group < options.groups)
        trials.run(group, values.data() + i * figures_of_group);
  };
  const std::string identity =
      fmt::format("uniformity {} groups {} seed {} balls {} draws {} sigma {} fle {} origin {}",
                  HELICARM_VERSION, options.groups, options.seed, options.balls, options.draws,
                  name_of(options.sigma), options.fle, name_of(options.origin));
  return run_study({setting}, identity, engine, ranks).map([&](const auto& kept) {
    return kept.empty() ? std::vector<UniformityGroup>{}
                        : records_of<UniformityGroup>(kept.front(), options.groups);
  });
}

StudyFiles files_of(const std::vector<UniformityGroup>& groups, const UniformityOptions& options) {
  StudyFiles files;
  files.csv = "group";
  for (const char* name : figure_names) files.csv += fmt::format(",{}", name);
  files.csv += '\n';
  for (std::size_t i = 0; i < groups.size(); ++i)
    files.csv += fmt::format("{}{}\n", i, csv_cells(numbers_of(groups[i])));

  const std::vector<double> evenness = figure_of(groups, 0);
  Json correlations = Json::array();
  double least = 1, most = -1, first_pearson = 0;
  for (std::size_t figure = 1; figure < figures_of_group; ++figure) {
    const std::vector<double> tre = figure_of(groups, figure);
    const double r = pearson(evenness, tre), rho = spearman(evenness, tre);
    if (figure == 1) first_pearson = r;
    least = std::min(least, rho);
    most = std::max(most, rho);
    correlations.push_back({{"tre", figure_names[figure]}, {"pearson", r}, {"spearman", rho}});
  }
  const double first_spearman = correlations[0]["spearman"];
  files.summary = fmt::format(
      "Published (Fig. 6): Pearson's correlation of E(A) with TRE is {}, weakly positive. Here, over {} "
      "groups of {} balls, targets in the sphere, one noise draw: Pearson {:.3f}, Spearman {:.3f}. "
      "Spearman's is {:.2f} to {:.2f} over target region, pixel noise and averaging over {} draws: evenly "
      "spread balls are better in every reading. The paper states neither the target positions nor the "
      "number of groups, and a few groups with a very large TRE dominate Pearson's coefficient.",
      printed_pearson, groups.size(), options.balls, first_pearson, first_spearman, least, most,
      options.draws);
  if (least <= 0)
    files.summary =
        files.summary.substr(0, files.summary.find(": evenly")) + ": not positive in every reading.";
  files.json = study_json("uniformity", options);
  files.json.update({{"balls", options.balls},
                     {"draws", options.draws},
                     {"printed", {{"pearson", printed_pearson}}},
                     {"summary", files.summary},
                     {"correlations", std::move(correlations)}});

  std::vector<report::Chart> charts;
  for (const std::size_t figure : {std::size_t{1}, std::size_t{7}}) {
    std::vector<double> tre = figure_of(groups, figure);
    report::Chart chart{
        figure == 1 ? "(a) one noise draw" : fmt::format("(b) mean of {} noise draws", options.draws),
        "Uniformity E(A)", "TRE of targets in the sphere of 100 mm, mm"};
    report::ChartSeries dots{"", {}, true};
    for (std::size_t i = 0; i < groups.size(); ++i) dots.points.push_back({evenness[i], tre[i]});
    chart.series.push_back(std::move(dots));
    chart.note = fmt::format("Pearson {:.3f}, Spearman {:.3f} (published: Pearson {})",
                             pearson(evenness, tre), spearman(evenness, tre), printed_pearson);
    chart.y_from_zero = true;
    chart.y_most = column_statistics(tre).p99;
    charts.push_back(std::move(chart));
  }
  files.svg = report::chart_svg(charts);
  return files;
}

}  // namespace helicarm::study
