// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>
#include <numeric>

#include "helicarm/track/first_markers.h"

namespace helicarm::track {
namespace {

/// Pairs connected by common discs: only these compete.
std::vector<std::vector<std::size_t>> components_of(const std::vector<DiscPair>& pairs) {
  std::vector<std::size_t> root(pairs.size());
  std::iota(root.begin(), root.end(), 0);
  const auto root_of = [&](std::size_t i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  for (std::size_t i = 0; i < pairs.size(); ++i)
    for (std::size_t k = i + 1; k < pairs.size(); ++k)
      if (pairs[i].first == pairs[k].first || pairs[i].second == pairs[k].second)
        root[root_of(i)] = root_of(k);
  std::vector<std::vector<std::size_t>> components(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) components[root_of(i)].push_back(i);
  std::erase_if(components, [](const auto& one) { return one.empty(); });
  return components;
}

/// Rows to columns at least total cost (Kuhn, Munkres; shortest augmenting paths); rows <= columns.
double least_assignment(const std::vector<std::vector<double>>& cost) {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  const std::size_t rows = cost.size(), columns = rows ? cost[0].size() : 0;
  std::vector<double> of_row(rows + 1), of_column(columns + 1);
  std::vector<std::size_t> row_at(columns + 1), came_from(columns + 1);
  for (std::size_t r = 1; r <= rows; ++r) {
    std::vector<double> least(columns + 1, infinite);
    std::vector<char> used(columns + 1);
    std::size_t at = 0;
    row_at[0] = r;
    do {
      used[at] = true;
      const std::size_t row = row_at[at];
      double delta = infinite;
      std::size_t next = 0;
      for (std::size_t c = 1; c <= columns; ++c) {
        if (used[c]) continue;
        const double reduced = cost[row - 1][c - 1] - of_row[row] - of_column[c];
        if (reduced < least[c]) least[c] = reduced, came_from[c] = at;
        if (least[c] < delta) delta = least[c], next = c;
      }
      for (std::size_t c = 0; c <= columns; ++c)
        if (used[c])
          of_row[row_at[c]] += delta, of_column[c] -= delta;
        else
          least[c] -= delta;
      at = next;
    } while (row_at[at] != 0);
    for (; at != 0; at = came_from[at]) row_at[at] = row_at[came_from[at]];
  }
  double total = 0;
  for (std::size_t c = 1; c <= columns; ++c)
    if (row_at[c] != 0) total += cost[row_at[c] - 1][c - 1];
  return total;
}

/// Least cost of the component's pairs without one of them (npos: with all); unmatched discs cost nothing.
double least_cost(const std::vector<DiscPair>& pairs, const std::vector<std::size_t>& component,
                  std::size_t without) {
  std::vector<std::size_t> firsts, seconds;
  for (const std::size_t i : component) {
    firsts.push_back(pairs[i].first);
    seconds.push_back(pairs[i].second);
  }
  for (auto* discs : {&firsts, &seconds}) {
    std::ranges::sort(*discs);
    discs->erase(std::ranges::unique(*discs).begin(), discs->end());
  }
  // A column of its own for each row stands for no partner.
  std::vector<std::vector<double>> cost(firsts.size(),
                                        std::vector<double>(seconds.size() + firsts.size(), 0));
  for (const std::size_t i : component) {
    if (i == without) continue;
    const auto row = std::size_t(std::ranges::lower_bound(firsts, pairs[i].first) - firsts.begin());
    const auto column = std::size_t(std::ranges::lower_bound(seconds, pairs[i].second) - seconds.begin());
    cost[row][column] = std::min(cost[row][column], pairs[i].cost);
  }
  return least_assignment(cost);
}

}  // namespace

std::vector<std::size_t> certain_pairs(const std::vector<DiscPair>& pairs, double margin) {
  constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> certain;
  for (const auto& component : components_of(pairs)) {
    const double least = least_cost(pairs, component, none);
    for (const std::size_t i : component)
      if (pairs[i].cost < 0 && least_cost(pairs, component, i) - least > margin) certain.push_back(i);
  }
  std::ranges::sort(certain);
  return certain;
}

}  // namespace helicarm::track
