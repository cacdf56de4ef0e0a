// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/distortion_map.h"

#include <algorithm>
#include <cmath>

namespace helicarm::rectification {

using Eigen::Vector2d;

bool DistortionMap::shows(const Vector2d& raw) const {
  return (raw.array() >= -0.5).all() && raw.x() <= width - 0.5 && raw.y() <= height - 0.5;
}

double DistortionMap::sigma_px(const Vector2d& rectified) const {
  return std::sqrt(std::max(0.0, covariance_px2({&rectified, 1})(0, 0)));
}

std::optional<Vector2d> rectified_in_image(const DistortionMap& map, const Vector2d& raw) {
  return map.shows(raw) ? map.rectified_from_raw(raw) : std::nullopt;
}

std::optional<Vector2d> raw_in_image(const DistortionMap& map, const Vector2d& rectified) {
  const Vector2d raw = map.raw_from_rectified(rectified);
  const auto back = rectified_in_image(map, raw);
  return back && (*back - rectified).norm() < 1e-6 ? std::optional(raw) : std::nullopt;
}

DistortionMap identity_map(int width, int height, std::optional<double> pixel_mm) {
  DistortionMap map;
  map.width = width;
  map.height = height;
  map.hull_high = {width - 1.0, height - 1.0};
  map.rectified_pixel_mm = pixel_mm;
  if (pixel_mm) map.rectified_plane = RectifiedPlane::detector;
  return map;
}

Json to_json(const DistortionMap& map) {
  Json json;
  json["format"] = "helicarm-map/1";
  json["model"] = map.model->name();
  json["image_size"] = {map.width, map.height};
  map.model->write(json);
  json["hull"] = {{map.hull_low.x(), map.hull_low.y()}, {map.hull_high.x(), map.hull_high.y()}};
  json["residual_rms_px"] = map.residual_rms_px;
  json["residual_max_px"] = map.residual_max_px;
  json["held_out_rms_px"] = map.held_out_rms_px;
  json["rectified_pixel_mm"] = map.rectified_pixel_mm ? Json(*map.rectified_pixel_mm) : Json();
  json["rectified_plane"] =
      map.rectified_plane ? Json(*map.rectified_plane == RectifiedPlane::detector ? "detector" : "plate")
                          : Json();
  return json;
}

Expected<DistortionMap> distortion_map_from_json(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    reader.choice("format", {"helicarm-map/1"});
    DistortionMap map;
    reader.text("model");
    const auto size = reader.numbers("image_size", 2, {1, 65535});
    map.width = static_cast<int>(size[0]);
    map.height = static_cast<int>(size[1]);
    const ModelKind* kind = model_kind(reader.optional_text("kind").value_or("polynomial"));
    if (!kind) reader.refuse(Reason::bad_value, "kind", "is none of " + model_names());
    map.model = kind->read(reader);
    const auto hull = reader.matrix("hull", 2, 2, {-1e9, 1e9});
    map.hull_low = {hull[0], hull[1]};
    map.hull_high = {hull[2], hull[3]};
    map.residual_rms_px = reader.number("residual_rms_px", {0, 1e6});
    map.residual_max_px = reader.number("residual_max_px", {0, 1e6});
    map.held_out_rms_px = reader.number("held_out_rms_px", {0, 1e6});
    map.rectified_pixel_mm = reader.optional_number("rectified_pixel_mm", {1e-4, 100});
    if (reader.has("rectified_plane"))
      map.rectified_plane = reader.choice("rectified_plane", {"detector", "plate"}) == 0
                                ? RectifiedPlane::detector
                                : RectifiedPlane::plate;
    else
      reader.raw("rectified_plane");
    reader.finish();
    return map;
  });
}

}  // namespace helicarm::rectification
