// SPDX-License-Identifier: Apache-2.0
#include "studies/statistics.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <numeric>
#include <vector>

namespace helicarm::study {
namespace {

constexpr double trimmed_share = 0.01;

/// Order statistics without a full sort: values are binned by their leading bits (256 bins per octave), and
/// only the bins that contain requested ranks are sorted.
class RankedValues {
 public:
  explicit RankedValues(std::span<const double> values) : dealt_(values.size()) {
    const auto [low, high] = std::ranges::minmax(values);
    first_ = key(low);
    const std::uint64_t bins = key(high) - first_ + 1;
    shift_more_ = bins > most_bins ? std::bit_width(bins / most_bins) : 0;
    begins_.resize((bins >> shift_more_) + 2);
    for (const double value : values) ++begins_[bin(value) + 1];
    std::partial_sum(begins_.begin(), begins_.end(), begins_.begin());
    std::vector<std::uint32_t> next = begins_;
    for (const double value : values) dealt_[next[bin(value)]++] = value;
  }

  double at(std::size_t rank) {
    const auto above = std::ranges::upper_bound(begins_, static_cast<std::uint32_t>(rank));
    sorted(std::size_t(above - begins_.begin()) - 1);
    return dealt_[rank];
  }
  /// Number of values less than this one, and number not greater.
  std::size_t less_than(double value) { return counted(std::ranges::lower_bound(sorted(bin(value)), value)); }
  std::size_t up_to(double value) { return counted(std::ranges::upper_bound(sorted(bin(value)), value)); }

  /// Linear interpolation between the two nearest ranks.
  double quantile(double share) {
    const double at_rank = share * double(dealt_.size() - 1);
    const auto below = static_cast<std::size_t>(at_rank);
    const double low = at(below);
    return at_rank > double(below) ? low + (at_rank - double(below)) * (at(below + 1) - low) : low;
  }

 private:
  static constexpr std::uint64_t most_bins = 1 << 14;
  static std::uint64_t key(double value) { return std::bit_cast<std::uint64_t>(value) >> 44; }
  std::size_t bin(double value) const { return (key(value) - first_) >> shift_more_; }
  std::size_t counted(std::span<double>::iterator end) const {
    return std::size_t(std::to_address(end) - dealt_.data());
  }

  std::span<double> sorted(std::size_t bin) {
    const auto content = std::span(dealt_).subspan(begins_[bin], begins_[bin + 1] - begins_[bin]);
    if (bin != last_sorted_) std::ranges::sort(content);
    last_sorted_ = bin;
    return content;
  }

  std::uint64_t first_ = 0;
  int shift_more_ = 0;
  std::vector<std::uint32_t> begins_;
  std::vector<double> dealt_;
  std::size_t last_sorted_ = most_bins + 2;
};

/// Fixed order in four accumulators: a reproducible sum without one long dependency chain.
template <class Term>
double sum_of(std::span<const double> values, Term term) {
  std::array<double, 4> strands{};
  std::size_t i = 0;
  for (; i + 4 <= values.size(); i += 4)
    for (std::size_t k = 0; k < 4; ++k) strands[k] += term(values[i + k]);
  for (; i < values.size(); ++i) strands[0] += term(values[i]);
  return (strands[0] + strands[1]) + (strands[2] + strands[3]);
}

double trimmed_mean(std::span<const double> values, RankedValues& ranked) {
  const std::size_t n = values.size();
  const auto cut = static_cast<std::size_t>(trimmed_share * double(n));
  const double low = ranked.at(cut), high = ranked.at(n - 1 - cut);
  if (!(low < high)) return low;
  const double inside = sum_of(values, [&](double x) { return x > low && x < high ? x : 0; });
  // Of values equal to a limit, those with ranks inside are counted.
  const double kept_low = double(ranked.up_to(low)) - double(cut);
  const double kept_high = double(n - ranked.less_than(high)) - double(cut);
  return (inside + kept_low * low + kept_high * high) / double(n - 2 * cut);
}

std::vector<double> ranks_of(std::span<const double> values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t i) { return values[i]; });
  std::vector<double> ranks(values.size());
  for (std::size_t i = 0; i < order.size();) {
    std::size_t end = i + 1;
    while (end < order.size() && values[order[end]] == values[order[i]]) ++end;
    for (std::size_t k = i; k < end; ++k) ranks[order[k]] = (double(i) + double(end - 1)) / 2;
    i = end;
  }
  return ranks;
}

}  // namespace

ColumnStatistics column_statistics(std::span<const double> all) {
  std::vector<double> finite;
  std::span<const double> values = all;
  if (!std::ranges::all_of(all, [](double x) { return std::isfinite(x); })) {
    std::ranges::copy_if(all, std::back_inserter(finite), [](double x) { return std::isfinite(x); });
    values = finite;
  }
  ColumnStatistics result;
  result.left_out = double(all.size() - values.size());
  if (values.empty()) {
    result.mean = result.median = result.trimmed = result.p99 = result.se = result.median_se =
        std::numeric_limits<double>::quiet_NaN();
    return result;
  }
  const auto n = double(values.size());
  result.mean = sum_of(values, [](double x) { return x; }) / n;
  const double squares = sum_of(values, [&](double x) { return (x - result.mean) * (x - result.mean); });
  result.se = n > 1 ? std::sqrt(squares / (n - 1) / n) : std::numeric_limits<double>::quiet_NaN();
  RankedValues ranked(values);
  result.median = ranked.quantile(0.5);
  // Ranks one standard error away, over three times as many values.
  const double half_width = 3 * 0.5 / std::sqrt(n);
  const double above = ranked.quantile(std::min(1.0, 0.5 + half_width));
  const double below = ranked.quantile(std::max(0.0, 0.5 - half_width));
  result.median_se = (above - below) / 6;
  result.p99 = ranked.quantile(0.99);
  result.trimmed = trimmed_mean(values, ranked);
  return result;
}

double pearson(std::span<const double> a, std::span<const double> b) {
  const auto n = double(a.size());
  const double mean_a = std::accumulate(a.begin(), a.end(), 0.0) / n;
  const double mean_b = std::accumulate(b.begin(), b.end(), 0.0) / n;
  double aa = 0, bb = 0, ab = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    aa += (a[i] - mean_a) * (a[i] - mean_a);
    bb += (b[i] - mean_b) * (b[i] - mean_b);
    ab += (a[i] - mean_a) * (b[i] - mean_b);
  }
  return ab / std::sqrt(aa * bb);
}

double spearman(std::span<const double> a, std::span<const double> b) {
  return pearson(ranks_of(a), ranks_of(b));
}

}  // namespace helicarm::study
