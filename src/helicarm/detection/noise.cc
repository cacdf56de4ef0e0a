// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/noise.h"

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <vector>

#include <Eigen/QR>

#include "helicarm/core/statistics.h"
#include "helicarm/detection/robust.h"

namespace helicarm::detection {
namespace {

constexpr int side = 32;
constexpr int reach = NoiseCorrelation::reach;
using Block = Eigen::Matrix<float, side, side, Eigen::RowMajor>;
using Column = Eigen::Matrix<float, side * side, 1>;
using Quadratic = Eigen::Matrix<float, side * side, 6>;

/// Autocovariances in a block: at lags along the axes, and summed over lags of one or two pixels on both
/// axes.
struct Lags {
  std::array<double, reach + 1> along{};
  double across = 0;
  float open = 0;  ///< number of pixels that contain only noise
};

/// Orthonormal columns that span all quadratics over a block.
const Quadratic& quadratics() {
  static const Quadratic columns = [] {
    Eigen::MatrixXf raw(side * side, 6);
    for (int v = 0; v < side; ++v)
      for (int u = 0; u < side; ++u) {
        const float x = float(u) / (0.5f * side) - 1;
        const float y = float(v) / (0.5f * side) - 1;
        raw.row(v * side + u) << 1, x, y, x * x, x * y, y * y;
      }
    return Quadratic(raw.householderQr().householderQ() *
                     Eigen::MatrixXf::Identity(Eigen::Index{side} * side, 6));
  }();
  return columns;
}

/// From the noise-only pixels (1, else 0).
Lags lags_of(const Block& block, const Block& open) {
  const bool all_open = open.minCoeff() > 0;
  const auto covariance_at = [&](int dx, int dy) {
    const int nx = side - std::abs(dx);
    const int ny = side - dy;
    const int x0 = std::max(0, -dx);
    const auto product = [&](const Block& of) {
      return double(of.block(0, x0, ny, nx).cwiseProduct(of.block(dy, x0 + dx, ny, nx)).sum());
    };
    return product(block) / std::max(1.0, all_open ? double(nx * ny) : product(open));
  };
  Lags lags;
  lags.open = open.sum();
  lags.along[0] = covariance_at(0, 0);
  for (int d = 1; d <= reach; ++d)
    lags.along[static_cast<std::size_t>(d)] = 0.5 * (covariance_at(d, 0) + covariance_at(0, d));
  for (const int dx : {-2, -1, 1, 2})
    for (const int dy : {1, 2}) lags.across += 0.5 * covariance_at(dx, dy);
  return lags;
}

/// Reduction of each lag by removing the quadratic, for unit noise per spatial frequency.
const Lags& lags_of_quadratics() {
  static const Lags sum = [] {
    Lags lags;
    for (int k = 0; k < 6; ++k) {
      const Lags one = lags_of(Eigen::Map<const Block>(quadratics().col(k).data()), Block::Ones());
      for (std::size_t d = 0; d < lags.along.size(); ++d) lags.along[d] += one.along[d];
      lags.across += one.across;
    }
    return lags;
  }();
  return sum;
}

std::optional<Lags> lags_of_block(const xray::XrayImage& xray_image, int u, int v, float floor,
                                  float ceiling) {
  Block block;
  for (int j = 0; j < side; ++j) {
    const float* row = xray_image.pixels.row(v + j) + u;
    for (int i = 0; i < side; ++i) block(j, i) = row[i];
  }
  if (block.minCoeff() <= floor || block.maxCoeff() >= ceiling) return std::nullopt;
  Eigen::Map<Column> grey(block.data());
  grey.array() -= grey.mean();
  // Clips a dot or a wire in the block to the noise level until the quadratic is not affected (Huber 1981).
  Column fitted = Column::Zero();
  float cut = 1e30f;
  for (int pass = 0; pass < 3; ++pass) {
    const Column residual = grey - fitted;
    cut = tukey_cut(std::span(residual.data(), std::size_t{side} * side), 0.f);
    const Column drawn_in = fitted + residual.cwiseMin(0.5f * cut).cwiseMax(-0.5f * cut);
    fitted = quadratics() * (quadratics().transpose() * drawn_in).eval();
  }
  grey -= fitted;
  const Block open = (block.array().abs() < 0.75f * cut).cast<float>();
  block.array() *= open.array();
  const Lags lags = lags_of(block, open);
  return lags.along[0] > 0 ? std::optional(lags) : std::nullopt;
}

}  // namespace

NoiseCorrelation noise_correlation(const xray::XrayImage& xray_image, float floor, float ceiling) {
  constexpr int blocks = 8;  // along each side of the image
  constexpr std::size_t enough = 8;
  const int step_u = std::max(side, xray_image.pixels.width() / blocks);
  const int step_v = std::max(side, xray_image.pixels.height() / blocks);
  std::vector<Lags> all;
  for (int v = (step_v - side) / 2; v + side <= xray_image.pixels.height(); v += step_v)
    for (int u = (step_u - side) / 2; u + side <= xray_image.pixels.width(); u += step_u)
      if (const auto lags = lags_of_block(xray_image, u, v, floor, ceiling)) all.push_back(*lags);
  NoiseCorrelation noise;
  if (all.size() < enough) return noise;
  // The half of the blocks with the most noise-only pixels.
  std::stable_sort(all.begin(), all.end(), [](const Lags& a, const Lags& b) { return a.open > b.open; });
  all.resize(std::max(enough, all.size() / 2));
  const auto typical = [&](auto&& of) {
    std::vector<double> values;
    for (const Lags& lags : all) values.push_back(of(lags) / lags.along[0]);
    return median(std::move(values));
  };
  std::array<double, reach + 1> along{};
  for (std::size_t d = 1; d < along.size(); ++d)
    along[d] = typical([&](const Lags& lags) { return lags.along[d]; });
  const double across = typical([](const Lags& lags) { return lags.across; });
  constexpr double least = 0.03;  // below: statistical fluctuation
  if (along[1] + along[2] < least) return noise;
  const Lags& taken = lags_of_quadratics();
  double origin = 0;  // noise spectrum at the quadratics' frequencies, relative to the remaining variance
  for (int pass = 0; pass < 4; ++pass) {
    const double variance = 1 + origin * taken.along[0];
    const auto whole = [&](std::size_t d) { return (along[d] + origin * taken.along[d]) / variance; };
    // Diagonal lags have correlation share a_i a_j, axial ones share a_i: the ratio gives the share.
    const double both = whole(1) + whole(2);
    const double both_across = std::max((across + origin * taken.across) / variance, both * both);
    const double share = std::max(both * both / both_across, whole(1));
    double sum = 1;
    noise.share = float(share);
    for (std::size_t d = 1; d < along.size(); ++d) {
      noise.along[d] = float(std::clamp(whole(d) / share, 0.0, double(noise.along[d - 1])));
      sum += 2 * double(noise.along[d]);
    }
    origin = variance * (1 - share + share * sum * sum);
  }
  return noise;
}

Eigen::MatrixXd correlated_normal(const NoiseCorrelation& noise, const PixelRows& rows,
                                  std::span<const int> cells, int width) {
  const std::vector<float> white(cells.size(), 1 - noise.share);
  Eigen::MatrixXd normal = weighted_products(rows, white);
  if (noise.share > 0) {
    // A margin of `reach` cells right of each row and around the grid keeps every lag inside it.
    const int stride = width + reach;
    const int size = stride * (*std::max_element(cells.begin(), cells.end()) / width + 1);
    const int rim = reach * stride;
    Eigen::ArrayXf grid(size + 2 * rim);
    Eigen::ArrayXf first(size + 2 * rim);
    Eigen::ArrayXf second(size + 2 * rim);
    std::vector<int> places;
    for (const int cell : cells) places.push_back(rim + cell / width * stride + cell % width);
    PixelRows spread(rows.rows(), static_cast<Eigen::Index>(cells.size()));
    const auto smooth = [&](const Eigen::ArrayXf& from, Eigen::ArrayXf& to, int step) {
      to.segment(rim, size) = from.segment(rim, size);
      for (int d = 1; d <= reach && noise.along[static_cast<std::size_t>(d)] > 0; ++d)
        to.segment(rim, size) += noise.along[static_cast<std::size_t>(d)] *
                                 (from.segment(rim - d * step, size) + from.segment(rim + d * step, size));
    };
    grid.setZero();
    first.setZero();
    for (Eigen::Index k = 0; k < rows.rows(); ++k) {
      for (std::size_t i = 0; i < places.size(); ++i) grid[places[i]] = rows(k, Eigen::Index(i));
      smooth(grid, first, 1);
      smooth(first, second, stride);
      for (std::size_t i = 0; i < places.size(); ++i) spread(k, Eigen::Index(i)) = second[places[i]];
    }
    normal += (noise.share * rows.leftCols(spread.cols()) * spread.transpose()).cast<double>();
  }
  return normal;
}

}  // namespace helicarm::detection
