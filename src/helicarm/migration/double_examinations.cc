// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/double_examinations.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace helicarm::migration {
namespace {

double value_of(const BodyMigration& body, int i) {
  return i < 3 ? body.rotation_deg[i] : body.translation_mm[i - 3];
}

double sigma_of(const BodyMigration& body, int i) {
  return (i < 3 ? 180 / EIGEN_PI : 1) * std::sqrt(body.covariance(i, i));
}

Precision precision_of(const std::string& name, const std::vector<const BodyMigration*>& found) {
  Precision precision{.body = name, .n = int(found.size())};
  const double n = precision.n;
  for (int i = 0; i < 6; ++i) {
    ZeroMotion& number = precision.numbers[std::size_t(i)];
    double squares = 0, stated = 0;
    for (const BodyMigration* body : found) number.mean += value_of(*body, i) / n;
    for (const BodyMigration* body : found) {
      squares += std::pow(value_of(*body, i) - number.mean, 2);
      stated += std::pow(sigma_of(*body, i), 2);
    }
    number.sd = std::sqrt(squares / (n - 1));
    number.limit_95 = student_975(n - 1) * number.sd;
    number.stated_sigma = std::sqrt(stated / n);
  }
  for (const BodyMigration* body : found) {
    precision.mtpm_mean_mm += body->mtpm_mm / n;
    precision.mtpm_largest_mm = std::max(precision.mtpm_largest_mm, body->mtpm_mm);
  }
  return precision;
}

/// Whether the markers of one are those of the other, or a part of them; names are free.
bool are_same(const Exam& a, const Exam& b) {
  const Exam &fewer = a.markers.size() <= b.markers.size() ? a : b, &more = &fewer == &a ? b : a;
  return std::ranges::all_of(fewer.markers, [&](const Marker& marker) {
    return std::ranges::any_of(more.markers, [&](const Marker& other) {
      return (marker.place - other.place).lpNorm<Eigen::Infinity>() <= same_place_mm;
    });
  });
}

}  // namespace

void require_new_exams(const ExamPair& pair, const std::vector<ExamPair>& earlier) {
  for (const auto& [first, second] : earlier) {
    const bool has_first = are_same(pair.first, first) || are_same(pair.second, first),
               has_second = are_same(pair.first, second) || are_same(pair.second, second);
    if (has_first && has_second)
      throw BadInput(Reason::bad_value,
                     fmt::format("the same pair as {} and {}: give each pair once", first.name, second.name));
    if (has_first || has_second)
      throw BadInput(Reason::bad_value,
                     fmt::format("has the examination {} of the pair {} and {}: each pair needs two "
                                 "examinations of its own, or the pairs are not independent",
                                 (has_first ? first : second).name, first.name, second.name));
  }
}

std::vector<Precision> precision_of(const std::vector<NamedMigration>& doubles) {
  std::vector<std::pair<std::string, std::vector<const BodyMigration*>>> of_name;
  for (const NamedMigration& each : doubles)
    for (const BodyMigration& body : each.migration.bodies) {
      const std::string& name = each.migration.segments[body.segment].name;
      auto found = std::ranges::find(of_name, name, [](const auto& entry) { return entry.first; });
      if (found == of_name.end()) found = of_name.insert(found, {name, {}});
      found->second.push_back(&body);
    }
  std::vector<Precision> precisions;
  for (const auto& [name, found] : of_name)
    if (found.size() > 1) precisions.push_back(precision_of(name, found));
  return precisions;
}

}  // namespace helicarm::migration
