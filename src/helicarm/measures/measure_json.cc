// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/measure_json.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/geometry/view_json.h"

namespace helicarm::measures {
namespace {

/// "from_anterior" is "from anterior".
std::string words_of(std::string name) {
  std::ranges::replace(name, '_', ' ');
  return name;
}

}  // namespace

Json to_json(const Measure& measure) {
  Json quantities = Json::array(), positions = Json::array();
  for (const Quantity& one : measure.quantities)
    quantities.push_back({{"name", one.name},
                          {"unit", one.unit},
                          {"value", one.value},
                          {"sigma", one.sigma ? Json(*one.sigma) : Json(nullptr)}});
  const auto components = info_of(measure.kind).components;
  for (const Position& position : measure.positions) {
    Json percent = Json::object();
    for (std::size_t i = 0; i < components.size(); ++i)
      percent[std::string(components[i])] = position.percent[Eigen::Index(i)];
    positions.push_back({{"point", position.point},
                         {"percent", percent},
                         {"covariance_percent2", geometry::json_rows(position.covariance)}});
  }
  return {{"kind", std::string(info_of(measure.kind).word)},
          {"depth_mm", measure.depth_mm ? Json(*measure.depth_mm) : Json(nullptr)},
          {"quantities", quantities},
          {"positions", positions}};
}

std::string sentence_of(const Quantity& quantity) {
  const int digits = quantity.unit == "deg" ? 1 : 2;
  const std::string value =
      fmt::format("{} {:.{}f} {}", words_of(quantity.name), quantity.value, digits, quantity.unit);
  return quantity.sigma ? fmt::format("{}, sigma {:.{}f}", value, *quantity.sigma, digits) : value;
}

std::string sentence_of(Kind kind, const Position& position) {
  std::string words = position.point;
  const auto components = info_of(kind).components;
  for (std::size_t i = 0; i < components.size(); ++i) {
    const auto at = Eigen::Index(i);
    words +=
        fmt::format("{} {} {:.1f} %, sigma {:.1f}", i == 0 ? "" : ";", words_of(std::string(components[i])),
                    position.percent[at], std::sqrt(position.covariance(at, at)));
  }
  return words;
}

}  // namespace helicarm::measures
