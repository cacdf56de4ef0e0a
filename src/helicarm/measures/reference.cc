// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/reference.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"

namespace helicarm::measures {
namespace {

constexpr double far_outside = 10;  // per cent; anatomical positions lie inside

bool is_inside(const Eigen::VectorXd& percent) {
  return percent.minCoeff() >= 0 && percent.maxCoeff() <= 100;
}

/// "FS" with "anterior" (20.0 %): exchanges of the point with a landmark, or of two landmarks, that give a
/// position inside.
std::vector<std::string> exchanges(const PercentAxes& axes, const std::string& name,
                                   const PlanarPoints& points, std::size_t point) {
  std::vector<std::pair<std::string, std::size_t>> clicks{{name, point}};
  for (const auto& [word, index] : axes.clicks.roles) clicks.emplace_back(word, index);
  std::vector<std::string> found;
  for (std::size_t i = 0; i < clicks.size(); ++i)
    for (std::size_t j = i + 1; j < clicks.size(); ++j) {
      PlanarPoints exchanged = points;
      std::swap(exchanged[clicks[i].second], exchanged[clicks[j].second]);
      const Eigen::VectorXd percent = axes.percent(exchanged, exchanged[point]);
      const bool runs_right =
          (axes.hundred(exchanged) - axes.zero(exchanged)).dot(axes.direction(exchanged)) > 0;
      if (percent.allFinite() && is_inside(percent) && runs_right)
        found.push_back(fmt::format("\"{}\" with \"{}\" ({:.1f} %)", clicks[i].first, clicks[j].first,
                                    fmt::join(percent, ", ")));
    }
  return found;
}

std::string advice(std::vector<std::string> found) {
  constexpr std::size_t most_named = 3;
  if (found.empty()) return "check the landmarks";
  found.resize(std::min(found.size(), most_named));
  return fmt::format("clicks are probably exchanged: {}", fmt::join(found, " or "));
}

}  // namespace

std::vector<Warning> reference_warnings(const PercentAxes& axes, const Position& position,
                                        const PlanarPoints& points, std::size_t point) {
  std::vector<Warning> warnings;
  const auto components = info_of(axes.kind).components;
  for (std::size_t i = 0; i < components.size(); ++i) {
    const auto at = Eigen::Index(i);
    const double percent = position.percent[at];
    const double error = normal_at_975 * std::sqrt(position.covariance(at, at));
    if (percent >= -error && percent <= 100 + error) continue;
    const bool is_far = percent < -far_outside || percent > 100 + far_outside;
    warnings.push_back(
        {Reason::outside_reference,
         fmt::format("{}: {} {:.1f} % lies outside 0 to 100 % by more than its error of {:.1f} % (95 %){}",
                     position.point, components[i], percent, error,
                     is_far ? ": " + advice(exchanges(axes, position.point, points, point)) : ""),
         {},
         {{"percent", percent}, {"error_95_percent", error}}});
  }
  return warnings;
}

}  // namespace helicarm::measures
