// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

namespace helicarm {

/// One column of a study's trials. Values that are not finite are counted and left out; with none left
/// everything else is NaN.
struct ColumnStatistics {
  double mean = 0;
  double median = 0;
  double trimmed = 0;    ///< mean without the lowest and the highest 1 %
  double p99 = 0;        ///< 99th percentile; this and the median are linear between ranks
  double se = 0;         ///< standard error of the mean
  double median_se = 0;  ///< standard error of the median, from the values about it
  double left_out = 0;
};

/// Of values that are not negative.
ColumnStatistics column_statistics(std::span<const double> values);

/// Pearson's correlation coefficient of two columns of equal length.
double pearson(std::span<const double> a, std::span<const double> b);

/// Spearman's: Pearson's of the ranks, ties sharing their mean rank.
double spearman(std::span<const double> a, std::span<const double> b);

}  // namespace helicarm
