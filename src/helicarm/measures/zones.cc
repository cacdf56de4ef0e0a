// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/zones.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/core/statistics.h"

namespace helicarm::measures {
namespace {

constexpr Range per_cent{-100, 200};

Zone::Extent extent_from(JsonReader& zone, const char* component) {
  if (!zone.has(component)) return {};
  JsonReader reader = zone.object(component);
  Zone::Extent extent{reader.optional_number("centre", per_cent), reader.optional_number("low", per_cent),
                      reader.optional_number("high", per_cent)};
  if (extent.low && extent.high && !(*extent.low < *extent.high))
    reader.refuse(Reason::bad_value, "high", "must be greater than \"low\"");
  reader.finish();
  return extent;
}

}  // namespace

const std::string& usual_zones_text() {
  static const std::string text = R"zones({
  "format": "helicarm-zones/1",
  "zones": [
    { "kind": "femoral_quadrants", "name": "centre of the ACL's femoral insertion",
      "source": "Bernard M, Hertel P, Hornung H, Cierpinski T. Am J Knee Surg 10(1), 14-21, 1997",
      "depth": { "centre": 24.8 }, "height": { "centre": 28.5 } },
    { "kind": "femoral_quadrants", "name": "femoral tunnels with fewer failures after 11 years",
      "source": "de Mees TTCR et al. Knee Surg Sports Traumatol Arthrosc 30(6), 2003-2013, 2022",
      "depth": { "high": 35.0 } },
    { "kind": "tibia_ap", "name": "the ACL's tibial attachment",
      "source": "Staeubli HU, Rauschning W. Knee Surg Sports Traumatol Arthrosc 2(3), 138-146, 1994",
      "from_anterior": { "centre": 43.3 } },
    { "kind": "tibia_ap", "name": "tibial tunnels of 19 navigated operations (42.3, standard deviation 1.4)",
      "source": "PubMed 22020962",
      "from_anterior": { "centre": 42.3 } }
  ]
}
)zones";
  return text;
}

Expected<std::vector<Zone>> zones_from(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    if (reader.text("format") != "helicarm-zones/1")
      reader.refuse(Reason::unsupported, "format", "must be \"helicarm-zones/1\"");
    std::vector<Zone> zones;
    for (JsonReader& each : reader.objects("zones", true, 1000)) {
      const std::string word = each.text("kind");
      const auto kind = kind_named(word);
      if (!kind || info_of(*kind).components.empty())
        each.refuse(Reason::bad_value, "kind",
                    fmt::format("\"{}\" is none of: femoral_quadrants, tibia_ap, tibia_ml", word));
      Zone zone{*kind, each.text("name"), each.text("source", 1000), {}};
      for (const std::string_view component : info_of(*kind).components)
        zone.extents.push_back(extent_from(each, std::string(component).c_str()));
      each.finish();
      zones.push_back(std::move(zone));
    }
    reader.finish();
    return zones;
  });
}

std::vector<ZoneFit> zone_fits(Kind kind, const Position& position, std::span<const Zone> zones) {
  std::vector<ZoneFit> fits;
  for (const Zone& zone : zones) {
    if (zone.kind != kind) continue;
    ZoneFit fit{zone.name, zone.source, {}};
    for (std::size_t i = 0; i < zone.extents.size(); ++i) {
      const auto at = Eigen::Index(i);
      const Zone::Extent& extent = zone.extents[i];
      const double percent = position.percent[at];
      const double error = normal_at_975 * std::sqrt(position.covariance(at, at));
      fit.from_centre.push_back(extent.centre ? std::optional(percent - *extent.centre) : std::nullopt);
      if ((extent.low && percent + error < *extent.low) || (extent.high && percent - error > *extent.high))
        fit.is_outside = true;
    }
    fits.push_back(std::move(fit));
  }
  return fits;
}

Json to_json(const ZoneFit& fit, Kind kind) {
  Json from_centre = Json::object();
  const auto components = info_of(kind).components;
  for (std::size_t i = 0; i < components.size(); ++i)
    from_centre[std::string(components[i])] = fit.from_centre[i] ? Json(*fit.from_centre[i]) : Json(nullptr);
  return {{"name", fit.zone},
          {"source", fit.source},
          {"from_centre_percent", from_centre},
          {"outside", fit.is_outside}};
}

std::string sentence_of(const ZoneFit& fit, Kind kind) {
  std::vector<std::string> words;
  const auto components = info_of(kind).components;
  for (std::size_t i = 0; i < components.size(); ++i)
    if (fit.from_centre[i])
      words.push_back(fmt::format("{} {:+.1f} %",
                                  components[i] == "from_anterior" ? "from anterior" : components[i],
                                  *fit.from_centre[i]));
  std::string text = fit.zone + ":";
  if (!words.empty()) text += fmt::format(" {} from it", fmt::join(words, ", "));
  if (fit.is_outside) text += fmt::format("{} outside", words.empty() ? "" : ",");
  if (words.empty() && !fit.is_outside) text += " not outside";
  return fmt::format("{} ({})", text, fit.source);
}

}  // namespace helicarm::measures
