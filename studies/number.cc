// SPDX-License-Identifier: Apache-2.0
#include "studies/number.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/core/parallel.h"
#include "studies/records.h"

namespace helicarm::study {
namespace {

constexpr std::size_t groups_per_block = 256;

struct NumberColumn {
  SigmaReading sigma;
  PixelReading reading;
  GroupError error;
};

bool is_of_balls(GroupError error) { return error == GroupError::fre || error == GroupError::fre_max; }

std::vector<NumberColumn> columns_of(const NumberOptions& options) {
  std::vector<NumberColumn> columns;
  for (const SigmaReading sigma : options.sigmas)
    for (const PixelReading reading : options.readings)
      for (const GroupError error : group_errors)
        if (is_of_balls(error) || reading != PixelReading::calibration_pixels)
          columns.push_back({sigma, reading, error});
  return columns;
}

/// The targets of all regions in one list.
struct PlacedTargets {
  std::vector<Eigen::Vector3d> points;
  std::size_t cone, middle;  ///< index of each region's first target

  explicit PlacedTargets(WorldOrigin origin)
      : points(targets_in_ball(origin)), cone(points.size()), middle(0) {
    const auto in_cone = targets_in_cone();
    points.insert(points.end(), in_cone.begin(), in_cone.end());
    middle = points.size();
    points.push_back(middle_of_cone());
  }
};

class NumberTrials {
 public:
  explicit NumberTrials(const NumberOptions& options)
      : options_(options),
        views_(paper_views(options.origin)),
        lane_views_(views_),
        placed_(options.origin),
        targets_(placed_.points, views_),
        columns_(columns_of(options)) {}

  std::size_t columns() const { return columns_.size(); }

  /// Groups first .. first + 3: their column c at out[c * stride].
  void run(std::size_t count, std::uint64_t first_group, double* out, std::size_t stride) const {
    const SimdRandom random(options_.seed, number_stream + std::uint32_t(count), first_group);
    const auto wants = [&](PixelReading reading) {
      return std::ranges::count(options_.readings, reading) > 0;
    };
    const std::vector<SimdPoint> balls = balls_on_spiral(random, count);
    SimdPixels exact, noise, fresh_noise, target_noise, calibrating, anew;
    for (std::size_t view = 0; view < 2; ++view)
      for (std::size_t i = 0; i < count; ++i) exact.of_view[view][i] = lane_views_.project(view, balls[i]);
    draw_noise(random, draw::calibration, count, noise);
    if (wants(PixelReading::fresh_noise)) {
      draw_noise(random, draw::fresh, count, fresh_noise);
      draw_noise(random, draw::targets, targets_.size(), target_noise);
    }
    const SimdBalls model(balls);
    for (const SigmaReading reading : options_.sigmas) {
      const double sigma = sigma_px(reading, options_.fle);
      add_noise(exact, sigma, noise, count, calibrating);
      const SimdProjection views[2] = {model.calibrate({calibrating.of_view[0], count}),
                                       model.calibrate({calibrating.of_view[1], count})};
      for (const PixelReading which : options_.readings) {
        if (which == PixelReading::calibration_pixels) {
          out = put_fre(balls, views, calibrating, out, stride);
        } else if (which == PixelReading::fresh_noise) {
          add_noise(exact, sigma, fresh_noise, count, anew);
          out = put_fre(balls, views, anew, out, stride);
          out = put_tre(views, sigma, &target_noise, out, stride);
        } else {
          out = put_fre(balls, views, exact, out, stride);
          out = put_tre(views, sigma, nullptr, out, stride);
        }
      }
    }
  }

  NumberRow row(int balls, std::size_t column, const ColumnStatistics& statistics) const {
    const NumberColumn& c = columns_[column];
    return {balls, c.sigma, c.reading, c.error, statistics};
  }

 private:
  static double* put(Simd value, double* out, std::size_t stride) {
    for (int i = 0; i < simd_width; ++i) out[i] = value[i];
    return out + stride;
  }

  static double* put_fre(const std::vector<SimdPoint>& balls, const SimdProjection (&views)[2],
                         const SimdPixels& pixels, double* out, std::size_t stride) {
    Simd sum{}, largest{};
    for (std::size_t i = 0; i < balls.size(); ++i) {
      const Simd error =
          norm(intersect(views[0], pixels.of_view[0][i], views[1], pixels.of_view[1][i]) - balls[i]);
      sum += error;
      largest = larger(error, largest);
    }
    out = put(sum / double(balls.size()), out, stride);
    return put(largest, out, stride);
  }

  double* put_tre(const SimdProjection (&views)[2], double sigma, const SimdPixels* noise, double* out,
                  std::size_t stride) const {
    out = put(targets_.mean_error(0, placed_.cone, views, sigma, noise), out, stride);
    out = put(targets_.mean_error(placed_.cone, placed_.middle, views, sigma, noise), out, stride);
    return put(targets_.mean_error(placed_.middle, targets_.size(), views, sigma, noise), out, stride);
  }

  NumberOptions options_;
  std::array<geometry::View, 2> views_;
  SimdViews lane_views_;
  PlacedTargets placed_;
  SimdTargets targets_;
  std::vector<NumberColumn> columns_;
};

/// The blocks' columns concatenated.
std::vector<double> column_of(std::span<const double> values, std::size_t columns, std::size_t column,
                              std::size_t groups) {
  std::vector<double> whole;
  whole.reserve(groups);
  for (std::size_t first = 0; first < groups; first += groups_per_block) {
    const auto from = values.begin() + std::ptrdiff_t(first * columns + column * groups_per_block);
    whole.insert(whole.end(), from, from + std::ptrdiff_t(std::min(groups_per_block, groups - first)));
  }
  return whole;
}

StudySetting setting_of(const NumberTrials& trials, std::size_t balls, std::size_t groups, unsigned threads) {
  StudySetting setting;
  setting.blocks = (groups + groups_per_block - 1) / groups_per_block;
  setting.values_per_block = groups_per_block * trials.columns();
  setting.cost = double(balls) + 20;  // constant part: targets
  setting.work = [&trials, balls, groups](std::size_t block, std::span<double> values) {
    const std::size_t first = block * groups_per_block;
    for (std::size_t i = 0; i < groups_per_block && first + i < groups; i += simd_width)
      trials.run(balls, first + i, values.data() + i, groups_per_block);
  };
  setting.settle = [&trials, groups, threads](std::span<const double> values) {
    std::vector<double> kept(trials.columns() * numbers_in<ColumnStatistics>);
    parallel_for(trials.columns(), threads, [&](std::size_t column) {
      std::span<double> to = std::span(kept).subspan(column * numbers_in<ColumnStatistics>);
      put_record(column_statistics(column_of(values, trials.columns(), column, groups)), to);
    });
    return kept;
  };
  return setting;
}

std::string identity_of(const NumberOptions& options) {
  std::vector<int> sigmas, readings;
  for (const auto sigma : options.sigmas) sigmas.push_back(int(sigma));
  for (const auto reading : options.readings) readings.push_back(int(reading));
  return fmt::format("number {} groups {} seed {} balls {} sigmas {} readings {} fle {} origin {}",
                     HELICARM_VERSION, options.groups, options.seed, options.balls, sigmas, readings,
                     options.fle, int(options.origin));
}

}  // namespace

std::string_view name_of(PixelReading reading) {
  constexpr std::array names{"calibration_pixels", "fresh_noise", "exact"};
  return names[std::size_t(reading)];
}

std::string_view name_of(GroupError error) {
  constexpr std::array names{"fre", "fre_max", "tre_ball", "tre_cone", "tre_centre"};
  return names[std::size_t(error)];
}

Expected<std::vector<NumberRow>> study_number(const NumberOptions& options, const EngineOptions& engine,
                                              const Ranks& ranks) {
  for (const int balls : options.balls)
    if (balls < 6 || balls > int(SimdBalls::most))
      return fail(Reason::bad_value, fmt::format("balls: {}, limits 6 and {}", balls, SimdBalls::most));
  std::vector<int> sorted = options.balls;
  std::ranges::sort(sorted);
  if (const auto twice = std::ranges::adjacent_find(sorted); twice != sorted.end())
    return fail(Reason::bad_value, fmt::format("balls: {} is given twice", *twice));
  if (options.groups < 1) return fail(Reason::bad_value, "groups: 0, at least 1 is required");
  const NumberTrials trials(options);
  std::vector<StudySetting> settings;
  for (const int balls : options.balls)
    settings.push_back(setting_of(trials, std::size_t(balls), options.groups, engine.threads));
  return run_study(settings, identity_of(options), engine, ranks).map([&](const auto& kept) {
    std::vector<NumberRow> rows;
    for (std::size_t i = 0; i < kept.size(); ++i) {
      std::span<const double> values = kept[i];
      for (std::size_t column = 0; column < trials.columns(); ++column)
        rows.push_back(trials.row(options.balls[i], column, take_record<ColumnStatistics>(values)));
    }
    return rows;
  });
}

}  // namespace helicarm::study
