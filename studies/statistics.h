// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

namespace helicarm::study {

/// Statistics of one column of a study's trials. Non-finite values are counted and left out; without any
/// finite value all others are NaN.
struct ColumnStatistics {
  double mean = 0;
  double median = 0;
  double trimmed = 0;    ///< mean without the lowest and the highest 1 %
  double p99 = 0;        ///< 99th percentile; this and the median are linear between ranks
  double se = 0;         ///< standard error of the mean
  double median_se = 0;  ///< standard error of the median, from the values about it
  double left_out = 0;
};

/// For non-negative values.
ColumnStatistics column_statistics(std::span<const double> values);

/// Pearson's correlation coefficient of two columns of equal length.
double pearson(std::span<const double> a, std::span<const double> b);

/// Spearman's rank correlation: Pearson's of the ranks, ties share their mean rank.
double spearman(std::span<const double> a, std::span<const double> b);

}  // namespace helicarm::study
