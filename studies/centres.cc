// SPDX-License-Identifier: Apache-2.0
#include "studies/centres.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "studies/centre_trial.h"
#include "studies/records.h"

namespace helicarm::study {
namespace {

constexpr double not_computed = std::numeric_limits<double>::quiet_NaN();
constexpr const char* whole_view = "cone before a knee";
constexpr double cost_of_case = 2;  // relative to that of an image, approximately

std::vector<CentreSituation> all_situations() {
  std::vector<CentreSituation> all;
  const auto add = [&](const char* group, const char* name, auto change) {
    CentreSituation situation{group, name};
    change(situation);
    all.push_back(situation);
  };
  using S = CentreSituation;
  add("as it is", "as it is", [](S&) {});
  add("fitted blur", "20 % too small", [](S& s) { s.blur_factor = 0.8; });
  add("fitted blur", "20 % too large", [](S& s) { s.blur_factor = 1.2; });
  add("diameter held", "true", [](S& s) { s.held_radius = 1; });
  add("diameter held", "5 % too small", [](S& s) { s.held_radius = 0.95; });
  add("diameter held", "5 % too large", [](S& s) { s.held_radius = 1.05; });
  add("scatter over direct", "0", [](S& s) { s.scatter = 0; });
  add("scatter over direct", "0.6", [](S& s) { s.scatter = 0.6; });
  add("background clipped", "20 %", [](S& s) { s.clipped = 0.2; });
  add("background clipped", "50 %", [](S& s) { s.clipped = 0.5; });
  add("across the ball", "wire over the middle third",
      [](S& s) { s.companion = Companion::wire_in_the_middle; });
  add("across the ball", "wire over a side's third", [](S& s) { s.companion = Companion::wire_beside; });
  add("across the ball", "ball 1.5 radii off", [](S& s) { s.companion = Companion::ball; });
  add("across the ball", "the same with places known",
      [](S& s) { s.companion = Companion::ball, s.places_known = true; });
  add("across the ball", "plate dot on the rim", [](S& s) { s.companion = Companion::plate_dot; });
  add("across the ball", "edge of a bone", [](S& s) { s.companion = Companion::bone; });
  add("quanta per pixel", "50", [](S& s) { s.quanta = 50; });
  add("quanta per pixel", "250", [](S& s) { s.quanta = 250; });
  add("quanta per pixel", "4000", [](S& s) { s.quanta = 4000; });
  add("quanta per pixel", "16000", [](S& s) { s.quanta = 16000; });
  add("screen blur sigma", "0 px", [](S& s) { s.screen_sigma_px = 0; });
  add("screen blur sigma", "1 px", [](S& s) { s.screen_sigma_px = 1; });
  add("screen blur sigma", "2 px", [](S& s) { s.screen_sigma_px = 2; });
  add("focus blur sigma", "1.5 px", [](S& s) { s.focus_sigma_px = 1.5; });
  add("picture", "logarithmic", [](S& s) { s.logarithmic = true; });
  add("ball", "2.5 mm", [](S& s) { s.diameter_mm = 2.5; });
  return all;
}

/// The sums over the images, for `kinds` of balls.
StudySetting summed_over(std::size_t images, std::size_t kinds) {
  StudySetting setting{images, kinds * numbers_in<CentreSums>};
  setting.settle = [size = setting.values_per_block](std::span<const double> values) {
    std::vector<double> sums(size);
    for (std::size_t i = 0; i < values.size(); ++i) sums[i % size] += values[i];
    return sums;
  };
  return setting;
}

CentreRow row_of(const std::string& group, const std::string& name, const CentreSums& all) {
  CentreRow row{group, name, int(all.balls), int(all.refused)};
  const double fitted = all.balls - all.refused;
  row.rms_px = std::sqrt(all.squares / (2 * fitted));
  row.bias_px = all.bias / fitted;
  row.sigma_px = std::sqrt(all.variances / fitted);
  row.z = std::sqrt(all.normed / (2 * fitted));
  row.radius_bias = all.radii / fitted;
  row.coverage = all.covered / fitted;
  row.bound_px = all.bounds > 0 ? std::sqrt(all.bound_squares / all.bounds) : not_computed;
  return row;
}

}  // namespace

Expected<std::vector<CentreRow>> study_centres(const CentreOptions& options, const EngineOptions& engine,
                                               const Ranks& ranks) {
  if (options.groups < 1) return fail(Reason::bad_value, "groups: 0, at least 1 is required");
  const auto squares = std::size_t(options.squares) * std::size_t(options.squares),
             measured = squares - (squares + 7) / 8;
  const std::size_t images = (options.groups + measured - 1) / measured;
  const auto wanted = [&](const std::string& group) {
    return options.only.empty() || std::ranges::count(options.only, group) > 0;
  };
  std::vector<CentreSituation> situations = all_situations();
  std::erase_if(situations, [&](const CentreSituation& s) { return !wanted(s.group); });
  std::vector<StudySetting> settings;
  for (const CentreSituation& situation : situations) {
    settings.push_back(summed_over(images, 1));
    settings.back().work = [&](std::size_t image, std::span<double> out) {
      put_record(try_image(situation, options.squares, options.seed, image), out);
    };
  }
  if (wanted(whole_view)) {
    settings.push_back(summed_over(images, 2));
    settings.back().cost = cost_of_case;
    settings.back().work = [&](std::size_t number, std::span<double> out) {
      put_record(try_case(options.seed + number), out);
    };
  }
  const std::string identity =
      fmt::format("centres {} groups {} seed {} only {} squares {}", HELICARM_VERSION, options.groups,
                  options.seed, options.only, options.squares);
  return run_study(settings, identity, engine, ranks).map([&](const auto& kept) {
    std::vector<CentreRow> rows;
    for (std::size_t i = 0; i < kept.size(); ++i) {
      std::span<const double> sums = kept[i];
      if (i < situations.size()) {
        rows.push_back(row_of(situations[i].group, situations[i].name, take_record<CentreSums>(sums)));
        continue;
      }
      for (const char* name : {"alone", "metal touches it"}) {
        rows.push_back(row_of(whole_view, name, take_record<CentreSums>(sums)));
        rows.back().bias_px = rows.back().radius_bias = not_computed;
      }
    }
    return rows;
  });
}

}  // namespace helicarm::study
