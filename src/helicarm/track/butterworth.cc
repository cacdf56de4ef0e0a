// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/butterworth.h"

#include <algorithm>
#include <cmath>

namespace helicarm::track {
namespace {

using Places = std::vector<Eigen::Vector3d>;

/// One pass of order 1 or 2; y = b x - a y, both with the newest first.
struct Pass {
  double b[3] = {}, a[3] = {1, 0, 0};
};

Pass pass_of(double rate_hz, const Butterworth& filter) {
  const int order = filter.order / 2;
  // Two passes leave half the amplitude where one leaves 1 / sqrt(2) (Winter, Biomechanics, 2009).
  const double k = std::tan(EIGEN_PI * filter.cut_off_hz / rate_hz) / std::pow(std::sqrt(2) - 1, 0.5 / order);
  if (order == 1) return {{k / (1 + k), k / (1 + k), 0}, {1, (k - 1) / (1 + k), 0}};
  const double norm = 1 / (1 + std::sqrt(2) * k + k * k), b = k * k * norm;
  return {{b, 2 * b, b}, {1, 2 * (k * k - 1) * norm, (1 - std::sqrt(2) * k + k * k) * norm}};
}

/// From rest at the first place.
void run(const Pass& pass, Places& places) {
  const Eigen::Vector3d start = places.front();
  Eigen::Vector3d first = Eigen::Vector3d::Zero(), second = first;
  for (Eigen::Vector3d& place : places) {
    const Eigen::Vector3d in = place - start, out = pass.b[0] * in + first;
    first = pass.b[1] * in - pass.a[1] * out + second;
    second = pass.b[2] * in - pass.a[2] * out;
    place = out + start;
  }
}

Places both_ways(const Pass& pass, const Places& places, std::size_t reach) {
  const std::size_t n = places.size(), pad = std::min(n - 1, reach);
  Places padded;
  for (std::size_t i = pad; i > 0; --i) padded.push_back(2 * places.front() - places[i]);
  padded.insert(padded.end(), places.begin(), places.end());
  for (std::size_t i = 1; i <= pad; ++i) padded.push_back(2 * places.back() - places[n - 1 - i]);
  for (int way = 0; way < 2; ++way) {
    run(pass, padded);
    std::ranges::reverse(padded);
  }
  return {padded.begin() + std::ptrdiff_t(pad), padded.begin() + std::ptrdiff_t(pad + n)};
}

}  // namespace

std::vector<std::optional<Eigen::Vector3d>> butterworth_filtered(
    const std::vector<std::optional<Eigen::Vector3d>>& places, double rate_hz, const Butterworth& filter) {
  const Pass pass = pass_of(rate_hz, filter);
  const auto reach = std::size_t(std::ceil(3 * rate_hz / filter.cut_off_hz));
  std::vector<std::optional<Eigen::Vector3d>> made = places;
  for (std::size_t begin = 0; begin < places.size();) {
    std::size_t end = begin;
    Places run_of_places;
    while (end < places.size() && places[end]) run_of_places.push_back(*places[end++]);
    if (!run_of_places.empty()) {
      const Places smooth = both_ways(pass, run_of_places, reach);
      std::ranges::copy(smooth, made.begin() + std::ptrdiff_t(begin));
    }
    begin = end + 1;
  }
  return made;
}

}  // namespace helicarm::track
