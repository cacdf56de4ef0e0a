// SPDX-License-Identifier: Apache-2.0
#include "studies/limit.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "studies/limit_trial.h"
#include "studies/records.h"

namespace helicarm::study {
namespace {

/// Statistics of a setting's trials for one place.
struct LimitFigures {
  double failures = 0, bound_mm = 0, error_mm = 0, dlt_mm = 0, coverage = 0;
};

LimitFigures limit_figures(const std::vector<LimitOutcomes>& trials, std::size_t place) {
  LimitFigures figures;
  double bounds = 0, bound_count = 0, dlt_count = 0;
  for (const LimitOutcomes& outcomes : trials) {
    const LimitOutcome& outcome = outcomes[place];
    figures.failures += 1 - outcome.located;
    figures.error_mm += outcome.error2;
    figures.coverage += outcome.covered;
    if (!std::isnan(outcome.dlt2)) figures.dlt_mm += outcome.dlt2, ++dlt_count;
    if (!std::isnan(outcome.bound2)) bounds += outcome.bound2, ++bound_count;
  }
  const double answered = double(trials.size()) - figures.failures;
  figures.bound_mm = std::sqrt(bounds / bound_count);
  figures.error_mm = std::sqrt(figures.error_mm / answered);
  figures.dlt_mm = std::sqrt(figures.dlt_mm / dlt_count);
  figures.coverage /= answered;
  return figures;
}

std::vector<LimitSetting> settings_of(const LimitOptions& options) {
  std::vector<LimitSetting> settings;
  std::uint32_t stream = 100;  // fixed for each setting, whichever are computed
  for (const int balls : {8, 12, 20})
    for (const double sigma : {0.1, 0.5, 1.0, 2.34})
      for (const LimitModel model : limit_models) settings.push_back({balls, sigma, model, stream++});
  std::erase_if(settings,
                [&](const LimitSetting& s) { return std::ranges::count(options.balls, s.balls) == 0; });
  return settings;
}

StudySetting work_of(const LimitSetting& setting, const LimitOptions& options) {
  StudySetting work{(options.groups + limit_trials_of_block - 1) / limit_trials_of_block,
                    limit_trials_of_block * numbers_in<LimitOutcomes>};
  work.work = [&](std::size_t block, std::span<double> out) {
    run_limit_trials(setting, options, block, out);
  };
  work.settle = [&](std::span<const double> values) {
    const auto trials = records_of<LimitOutcomes>(values, options.groups);
    std::vector<double> kept(rows_of_limit_setting * numbers_in<LimitFigures>);
    std::span<double> to = kept;
    for (std::size_t k = 0; k < rows_of_limit_setting; ++k) put_record(limit_figures(trials, k), to);
    return kept;
  };
  return work;
}

}  // namespace

Expected<std::vector<LimitRow>> study_limit(const LimitOptions& options, const EngineOptions& engine,
                                            const Ranks& ranks) {
  if (options.groups < 1) return fail(Reason::bad_value, "groups: 0, at least 1 is required");
  constexpr std::array model_names{"free", "square", "prior", "machine", "known"};
  const std::vector<LimitSetting> settings = settings_of(options);
  std::vector<StudySetting> work;
  for (const LimitSetting& setting : settings) work.push_back(work_of(setting, options));
  const std::string identity = fmt::format("limit {} groups {} seed {} balls {}", HELICARM_VERSION,
                                           options.groups, options.seed, options.balls);
  return run_study(work, identity, engine, ranks).map([&](const auto& kept) {
    std::vector<LimitRow> rows;
    for (std::size_t i = 0; i < kept.size(); ++i) {
      std::span<const double> values = kept[i];
      for (std::size_t k = 0; k < rows_of_limit_setting; ++k) {
        const LimitSetting& s = settings[i];
        const auto f = take_record<LimitFigures>(values);
        rows.push_back({s.balls, s.sigma_px, model_names[std::size_t(s.model)], limit_places[k / 2].name,
                        k % 2 == 1, int(options.groups), int(f.failures), f.bound_mm, f.error_mm, f.dlt_mm,
                        f.coverage});
      }
    }
    return rows;
  });
}

}  // namespace helicarm::study
