// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/normal_equations.h"

#include <algorithm>
#include <array>

namespace helicarm::detection {
namespace {

using Eigen::Index;

constexpr int simd_width = 8;
using Simd = Eigen::Array<float, simd_width, 1>;

// As many sums as fit the registers besides their operands.
constexpr int tall = 4;
constexpr int wide = 3;

template <int Count>
using Rows = std::array<const float*, Count>;

Simd load(const float* from) { return Eigen::Map<const Simd>(from); }

void add_tile(const Rows<tall>& left, const Rows<wide>& right, const float* weights, Index count,
              float (&sums)[tall][wide]) {
  Simd wide_sums[tall][wide];
  for (auto& row : wide_sums)
    for (Simd& sum : row) sum.setZero();
  const Index whole = count / simd_width * simd_width;
  for (Index i = 0; i < whole; i += simd_width) {
    const Simd weight = load(weights + i);
    const Simd b[wide] = {load(right[0] + i), load(right[1] + i), load(right[2] + i)};
    for (int a = 0; a < tall; ++a) {
      const Simd weighted = weight * load(left[static_cast<std::size_t>(a)] + i);
      for (int k = 0; k < wide; ++k) wide_sums[a][k] += weighted * b[k];
    }
  }
  for (int a = 0; a < tall; ++a)
    for (int k = 0; k < wide; ++k) {
      const float* one = left[static_cast<std::size_t>(a)];
      const float* other = right[static_cast<std::size_t>(k)];
      float sum = wide_sums[a][k].sum();
      for (Index i = whole; i < count; ++i) sum += weights[i] * one[i] * other[i];
      sums[a][k] = sum;
    }
}

}  // namespace

Eigen::MatrixXd weighted_products(const PixelRows& rows, std::span<const float> weights) {
  constexpr Index block = 1024;  // float sums stay accurate over this many
  const Index n = rows.rows();
  const auto end = static_cast<Index>(weights.size());
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(n, n);
  for (Index start = 0; start < end; start += block) {
    const Index count = std::min(block, end - start);
    for (Index i = 0; i < n; i += tall)
      for (Index j = 0; j < std::min(n, i + tall); j += wide) {
        // Past the last row, repeats the last row; the result is not used.
        Rows<tall> left;
        Rows<wide> right;
        for (Index a = 0; a < tall; ++a)
          left[static_cast<std::size_t>(a)] = &rows(std::min(i + a, n - 1), start);
        for (Index b = 0; b < wide; ++b)
          right[static_cast<std::size_t>(b)] = &rows(std::min(j + b, n - 1), start);
        float sums[tall][wide];
        add_tile(left, right, weights.data() + start, count, sums);
        for (Index a = 0; a < tall && i + a < n; ++a)
          for (Index b = 0; b < wide && j + b < n; ++b) products(i + a, j + b) += double(sums[a][b]);
      }
  }
  return products.selfadjointView<Eigen::Lower>();
}

}  // namespace helicarm::detection
