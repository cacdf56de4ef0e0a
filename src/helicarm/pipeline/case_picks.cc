// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case_picks.h"

#include <algorithm>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/pipeline/case_purpose.h"
#include "helicarm/pipeline/view_image.h"
#include "helicarm/rectification/distortion_map.h"

namespace helicarm::pipeline {
namespace {

bool is_named(const Json& pick, const std::string& name) {
  return pick.is_object() && pick.value("name", Json()) == Json(name);
}

/// The picks of a case.json; null and absent are an empty list.
Json& picks_of(Json& json) {
  if (!json.contains("picks") || json["picks"].is_null()) json["picks"] = Json::array();
  return json["picks"];
}

Json new_pick(const Json& picks, const std::string& name, const std::string& view) {
  Json pick = {{"name", name}, {"view", view}, {"uv", nullptr}};
  for (const Json& other : picks)
    for (const char* key : {"moves_with", "bone"})
      if (is_named(other, name) && other.contains(key)) pick[key] = other[key];
  return pick;
}

/// Refuses a row of a view that the case does not have.
void check_view(const Case& the_case, const std::string& view, const std::string& where) {
  std::vector<std::string> names;
  for (const CaseView& each : the_case.views) names.push_back(each.name);
  if (std::ranges::count(names, view) == 0)
    throw BadInput(Reason::bad_value, fmt::format("{}: view: \"{}\" is not a view of the case (views: {})",
                                                  where, view, fmt::join(names, ", ")));
}

}  // namespace

Expected<PickedCase> with_picks(Json json, const CsvTable& table, const std::string& origin,
                                const std::filesystem::path& folder) {
  return guarded([&] {
    const Case the_case = value_or_throw(case_from_json(json, "case.json", folder, purpose_of(json)));
    if (table.rows() == 0)
      throw BadInput(Reason::bad_value, fmt::format("{}: the table has no rows", origin));
    PickedCase picked{std::move(json)};
    Json& picks = picks_of(picked.json);
    std::set<std::pair<std::string, std::string>> rows;
    for (std::size_t row = 0; row < table.rows(); ++row) {
      const std::string &name = table.text(row, "name"), &view = table.text(row, "view");
      const std::string where = fmt::format("{}: row {}", origin, row + 1);
      check_view(the_case, view, where);
      if (!rows.emplace(name, view).second)
        throw BadInput(Reason::name_clash,
                       fmt::format("{}: \"{}\" is given twice in \"{}\"", where, name, view));
      auto pick = std::find_if(picks.begin(), picks.end(), [&](const Json& other) {
        return is_named(other, name) && other.value("view", Json()) == Json(view);
      });
      const bool known = pick != picks.end();
      ++(known ? picked.replaced : picked.added);
      if (!known) {
        picks.push_back(new_pick(picks, name, view));
        pick = picks.end() - 1;
      }
      (*pick)["uv"] = {table.number(row, "u_px"), table.number(row, "v_px")};
      if (const auto sigma = table.optional_number(row, "sigma_px")) (*pick)["sigma_px"] = *sigma;
    }
    value_or_throw(case_from_json(picked.json, "case.json", folder, purpose_of(picked.json)));
    return picked;
  });
}

Expected<void> check_in_images(const CsvTable& table, const std::string& origin, const Case& the_case) {
  return guarded([&] {
    for (const CaseView& view : the_case.views) {
      std::optional<xray::XrayImage> image;
      for (std::size_t row = 0; row < table.rows(); ++row) {
        if (table.text(row, "view") != view.name) continue;
        if (!image) image = value_or_throw(image_of(view));
        const Eigen::Vector2d uv(table.number(row, "u_px"), table.number(row, "v_px"));
        const int width = image->pixels.width(), height = image->pixels.height();
        if (!rectification::identity_map(width, height, {}).shows(uv))
          throw BadInput({Reason::bad_value,
                          fmt::format("{}: row {}: {:g}, {:g} lies outside the image of {} x {} pixels",
                                      origin, row + 1, uv.x(), uv.y(), width, height),
                          view.name,
                          {}});
      }
    }
  });
}

Expected<Json> with_all_picks(Json json, const std::vector<Pick>& picks,
                              const std::vector<CaseTunnel>& tunnels, const std::filesystem::path& folder) {
  return guarded([&] {
    const Case before = value_or_throw(case_from_json(json, "case.json", folder, purpose_of(json)));
    json["picks"] = Json::array();
    for (const Pick& pick : picks) json["picks"].push_back(to_json(pick));
    if (!json.contains("tunnels") || json["tunnels"].is_null()) json["tunnels"] = Json::array();
    const auto is_picked = [&](const std::string& name) {
      return std::ranges::find(picks, name, &Pick::name) != picks.end();
    };
    for (const CaseTunnel& tunnel : tunnels)
      if (is_picked(tunnel.start) && is_picked(tunnel.end) &&
          std::ranges::find(before.tunnels, tunnel.name, &CaseTunnel::name) == before.tunnels.end())
        json["tunnels"].push_back({{"name", tunnel.name}, {"start", tunnel.start}, {"end", tunnel.end}});
    if (json["tunnels"].empty()) json.erase("tunnels");
    value_or_throw(case_from_json(json, "case.json", folder, purpose_of(json)));
    return json;
  });
}

}  // namespace helicarm::pipeline
