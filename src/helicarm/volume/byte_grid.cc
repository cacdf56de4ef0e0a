// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/byte_grid.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>

namespace helicarm::volume {
namespace {

using Row = std::span<const std::uint8_t>;

bool is_constant(Row row) { return std::ranges::adjacent_find(row, std::not_equal_to<>()) == row.end(); }

/// Half of a symmetric kernel, from its middle, of sum 1.
std::vector<float> gaussian(double sigma) {
  std::vector<float> weights;
  float sum = 0;
  for (int k = 0; k <= int(std::ceil(3 * sigma)); ++k) {
    weights.push_back(static_cast<float>(std::exp(-0.5 * k * k / (sigma * sigma))));
    sum += (k > 0 ? 2 : 1) * weights.back();
  }
  for (float& weight : weights) weight /= sum;
  return weights;
}

void add(std::vector<float>& sums, Row row, float weight) {
  for (std::size_t x = 0; x < sums.size(); ++x) sums[x] += weight * static_cast<float>(row[x]);
}

void round_to(const std::vector<float>& sums, std::uint8_t* row) {
  for (std::size_t x = 0; x < sums.size(); ++x) row[x] = static_cast<std::uint8_t>(sums[x] + 0.5F);
}

void smooth_along_rows(ByteGrid& grid, const std::vector<float>& weights) {
  const auto columns = std::size_t(grid.size.x()), reach = weights.size() - 1;
  std::vector<std::uint8_t> padded(columns + 2 * reach);
  std::vector<float> sums(columns);
  for (std::size_t from = 0; from < grid.values.size(); from += columns) {
    std::uint8_t* row = grid.values.data() + from;
    if (is_constant({row, columns})) continue;
    std::fill_n(padded.begin(), reach, row[0]);
    std::copy_n(row, columns, padded.begin() + std::ptrdiff_t(reach));
    std::fill_n(padded.end() - std::ptrdiff_t(reach), reach, row[columns - 1]);
    std::ranges::fill(sums, 0.0F);
    const std::uint8_t* middle = padded.data() + reach;
    add(sums, {middle, columns}, weights[0]);
    for (std::size_t k = 1; k <= reach; ++k) {
      add(sums, {middle - k, columns}, weights[k]);
      add(sums, {middle + k, columns}, weights[k]);
    }
    round_to(sums, row);
  }
}

void smooth_across_rows(ByteGrid& grid, int axis, const std::vector<float>& weights) {
  const auto columns = std::size_t(grid.size.x()), rows = std::size_t(grid.size.y());
  const int count = grid.size[axis], reach = int(weights.size()) - 1;
  const ByteGrid from = grid;
  const auto row = [&](std::size_t i) -> Row { return {from.values.data() + columns * i, columns}; };
  std::vector<std::uint8_t> constant(rows * std::size_t(grid.size.z()));
  for (std::size_t i = 0; i < constant.size(); ++i) constant[i] = is_constant(row(i));
  std::vector<float> sums(columns);
  for (std::size_t here = 0; here < constant.size(); ++here) {
    const std::size_t y = here % rows, z = here / rows;
    const auto beside = [&](int k) {
      const auto at = std::size_t(std::clamp(int(axis == 1 ? y : z) + k, 0, count - 1));
      return axis == 1 ? at + rows * z : y + rows * at;
    };
    int k = -reach;
    while (k <= reach && constant[beside(k)] != 0 && row(beside(k))[0] == row(here)[0]) ++k;
    if (k > reach) continue;
    std::ranges::fill(sums, 0.0F);
    for (k = -reach; k <= reach; ++k) add(sums, row(beside(k)), weights[std::size_t(std::abs(k))]);
    round_to(sums, grid.values.data() + columns * here);
  }
}

}  // namespace

ByteGrid byte_grid(const Eigen::Vector3i& size) {
  return {size, std::vector<std::uint8_t>(
                    std::size_t(size.x()) * std::size_t(size.y()) * std::size_t(size.z()), 0)};
}

void smooth(ByteGrid& grid, const Eigen::Vector3d& sigma) {
  if (grid.values.empty()) return;
  smooth_along_rows(grid, gaussian(sigma.x()));
  for (const int axis : {1, 2}) smooth_across_rows(grid, axis, gaussian(sigma[axis]));
}

}  // namespace helicarm::volume
