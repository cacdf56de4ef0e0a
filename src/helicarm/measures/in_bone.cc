// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/in_bone.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/measures/measure_json.h"

namespace helicarm::measures {
namespace {

/// The landmarks' images measured as clicks; nothing where that determines no measure.
std::vector<Position> projected_positions(Kind kind, std::span<const Landmark> landmarks,
                                          const geometry::RigidTransform& world_from_bone,
                                          const geometry::View& view) {
  std::vector<Click> clicks;
  for (const Landmark& each : landmarks) {
    if (each.name == axis_medial || each.name == axis_lateral) continue;
    const Eigen::Matrix3d& rotation = world_from_bone.rotation;
    auto click = click_of(each.name, world_from_bone * each.at,
                          rotation * each.covariance_mm2 * rotation.transpose(), view);
    if (!click) return {};
    clicks.push_back(*std::move(click));
  }
  auto measure = measures::measure(kind, clicks, {});
  return measure ? std::move(measure->positions) : std::vector<Position>();
}

Json position_json(Kind kind, const Position& position) {
  return to_json(Measure{kind, {}, {position}}).at("positions").at(0);
}

Json positions_json(Kind kind, std::span<const Position> positions) {
  Json list = Json::array();
  for (const Position& position : positions) list.push_back(position_json(kind, position));
  return list;
}

Json to_json(const LateralView& view, Kind kind) {
  return {{"view", view.view},
          {"off_deg", view.lateral.off_deg},
          {"apart_mm", view.lateral.apart_mm},
          {"is_lateral", view.is_lateral},
          {"message", sentence_of(view)},
          {"positions", positions_json(kind, view.projected)}};
}

}  // namespace

std::vector<LateralView> lateral_views(Kind kind, std::span<const Landmark> landmarks,
                                       const geometry::RigidTransform& world_from_bone,
                                       std::span<const NamedView> views) {
  const auto medial = std::ranges::find(landmarks, axis_medial, &Landmark::name);
  const auto lateral = std::ranges::find(landmarks, axis_lateral, &Landmark::name);
  std::vector<LateralView> laterals;
  if (medial == landmarks.end() || lateral == landmarks.end()) return laterals;
  for (const NamedView& view : views) {
    const auto found = lateral_of(view.view, world_from_bone * medial->at, world_from_bone * lateral->at);
    if (found && found->off_deg <= nearly_lateral_deg)
      laterals.push_back({view.name, *found, found->apart_mm <= most_apart_mm,
                          projected_positions(kind, landmarks, world_from_bone, view.view)});
  }
  return laterals;
}

Expected<InBone> measure_in_bone(const std::string& name, const std::string& model, Kind kind,
                                 std::span<const Landmark> landmarks, std::span<const Zone> zones,
                                 const std::optional<geometry::RigidTransform>& world_from_bone,
                                 std::span<const NamedView> views) {
  auto measure = measure_in_space(kind, landmarks);
  if (!measure) {
    Failure failure = std::move(measure).error();
    failure.message = fmt::format("measure \"{}\": {}", name, failure.message);
    return tl::unexpected<Failure>(std::move(failure));
  }
  InBone found{name, model, *std::move(measure), {}};
  for (const Position& position : found.measure.positions)
    found.zones.push_back(zone_fits(kind, position, zones));
  if (world_from_bone) found.laterals = lateral_views(kind, landmarks, *world_from_bone, views);
  return found;
}

Expected<std::vector<Zone>> zones_of(const std::optional<std::filesystem::path>& file) {
  const auto json = file ? read_json(*file) : parse_json(usual_zones_text(), "zones");
  return json.and_then(
      [&](const Json& zones) { return zones_from(zones, file ? file->filename().string() : "zones"); });
}

Json to_json(const InBone& of) {
  const Kind kind = of.measure.kind;
  Json json{{"name", of.name}, {"model", of.model}, {"view", nullptr}};
  json.update(to_json(of.measure));
  for (std::size_t i = 0; i < of.measure.positions.size(); ++i) {
    Json fits = Json::array(), warnings = Json::array();
    for (const ZoneFit& fit : of.zones[i]) fits.push_back(to_json(fit, kind));
    for (const Warning& warning : of.measure.positions[i].warnings)
      warnings.push_back({{"code", code(warning.reason)}, {"message", warning.message}});
    json["positions"][i]["zones"] = std::move(fits);
    json["positions"][i]["warnings"] = std::move(warnings);
  }
  json["laterals"] = Json::array();
  for (const LateralView& view : of.laterals) json["laterals"].push_back(to_json(view, kind));
  json["clicked"] = Json::array();
  for (const InImage& image : of.clicked)
    json["clicked"].push_back({{"view", image.view}, {"positions", positions_json(kind, image.positions)}});
  json["missing"] = of.missing;
  return json;
}

std::string sentence_of(const LateralView& view) {
  return fmt::format("{}: {:.1f} degrees off a true lateral image, the axis' ends {:.1f} mm apart{}",
                     view.view, view.lateral.off_deg, view.lateral.apart_mm,
                     view.is_lateral ? ""
                                     : fmt::format(": over {:g} mm: this image is no lateral one, and per "
                                                   "cent clicked in it are of another projection",
                                                   most_apart_mm));
}

std::vector<Line> lines_of(const InBone& of) {
  const Kind kind = of.measure.kind;
  std::vector<Line> lines{{fmt::format("{} ({}, in space{})", of.name, info_of(kind).label,
                                       of.model.empty() ? "" : ", " + of.model)}};
  for (const Quantity& quantity : of.measure.quantities) lines.push_back({sentence_of(quantity), 1});
  for (std::size_t i = 0; i < of.measure.positions.size(); ++i) {
    const Position& position = of.measure.positions[i];
    lines.push_back({sentence_of(kind, position), 1});
    for (const ZoneFit& fit : of.zones[i]) lines.push_back({sentence_of(fit, kind), 2});
    for (const Warning& warning : position.warnings) lines.push_back({warning.message, 1, true});
  }
  for (const LateralView& view : of.laterals) {
    lines.push_back({sentence_of(view), 1, !view.is_lateral});
    for (const Position& position : view.projected)
      lines.push_back({"the landmarks' images there: " + sentence_of(kind, position), 2});
  }
  for (const InImage& image : of.clicked)
    for (const Position& position : image.positions)
      lines.push_back({fmt::format("{}, clicked: {}", image.view, sentence_of(kind, position)), 1});
  for (const std::string& name : of.missing) lines.push_back({name + ": not located", 1});
  return lines;
}

}  // namespace helicarm::measures
