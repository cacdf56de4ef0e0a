// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/view_map.h"

#include <fmt/format.h>

namespace helicarm::track {

void take_map(TrackView& view, std::optional<rectification::DistortionMap> map, const std::string& where) {
  view.map = std::move(map);
  if (!view.map) return;
  const Eigen::Vector2i size(view.map->width, view.map->height);
  if (view.image_size && *view.image_size != size)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: \"map\" is for images of {} x {} pixels, \"camera\" for {} x {}", where,
                               size.x(), size.y(), view.image_size->x(), view.image_size->y()));
  view.image_size = size;
}

std::optional<Eigen::Vector2d> rectified_in(const TrackView& view, const Eigen::Vector2d& raw) {
  return view.map ? view.map->rectified_from_raw(raw) : std::optional(raw);
}

std::optional<Eigen::Vector2d> raw_in(const TrackView& view, const Eigen::Vector2d& rectified) {
  constexpr double same_px = 1e-6;
  if (!view.map) return rectified;
  const Eigen::Vector2d raw = view.map->raw_from_rectified(rectified);
  const auto back = raw.allFinite() ? rectified_in(view, raw) : std::nullopt;
  return back && (*back - rectified).norm() < same_px ? std::optional(raw) : std::nullopt;
}

void refuse_outside_map(const std::string& what, const TrackView& view, const Eigen::Vector2d& raw) {
  const rectification::DistortionMap& map = *view.map;
  throw BadInput(
      {Reason::bad_value,
       fmt::format("{}: at {:.1f}, {:.1f}, outside the distortion map of {}, whose dots cover {:.0f}, {:.0f} "
                   "to {:.0f}, {:.0f} of its image of {} x {} pixels: there it has no rectified place",
                   what, raw.x(), raw.y(), view.images.name, map.hull_low.x(), map.hull_low.y(),
                   map.hull_high.x(), map.hull_high.y(), map.width, map.height),
       view.images.name,
       {{"u_px", raw.x()}, {"v_px", raw.y()}}});
}

void check_pick_in_map(const TrackCase& the_case, const MarkerPick& pick, int first_frame) {
  const TrackView& view = the_case.views[pick.view];
  if (!rectified_in(view, pick.uv_raw))
    refuse_outside_map(fmt::format("picks: \"{}\" in {}, frame {}", the_case.markers[pick.marker],
                                   view.images.name, pick.frame.value_or(first_frame)),
                       view, pick.uv_raw);
}

void check_picks_in_maps(const TrackCase& the_case, int first_frame) {
  for (const auto* picks : {&the_case.picks, &the_case.corrections})
    for (const MarkerPick& pick : *picks) check_pick_in_map(the_case, pick, first_frame);
}

}  // namespace helicarm::track
