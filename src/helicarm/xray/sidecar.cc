// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/sidecar.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/json.h"
#include "helicarm/xray/dicom_acquisition.h"

namespace helicarm::xray {
namespace fs = std::filesystem;

namespace {

fs::path full_name(const fs::path& image) {
  fs::path name = image;
  return name += ".json";
}

fs::path short_name(const fs::path& image) {
  fs::path name = image;
  return name.replace_extension(".json");
}

/// A sidecar holds numbers alone. An object with lists, objects or a format, and without a sidecar's keys, is
/// the file of another program or another part of this one. What cannot be read is left to be refused.
bool is_other_json(const fs::path& path) {
  const auto json = read_json(path);
  if (!json || !json->is_object()) return false;
  for (const char* key : {"pixel_mm", "source_detector_mm", "primary_deg", "secondary_deg"})
    if (json->contains(key)) return false;
  return json->contains("format") ||
         std::ranges::any_of(*json, [](const Json& value) { return value.is_structured(); });
}

void check_agreement(double own, double stated, const char* key, const std::string& image,
                     const std::string& origin) {
  constexpr double tolerance = 0.01;
  const double difference = std::abs(stated / own - 1);
  if (difference <= tolerance) return;
  throw BadInput(
      {Reason::bad_value,
       fmt::format("{}: \"{}\" is {:g}, the image{} itself states {:g}: they differ by {:.3g} %, limit 1 %; "
                   "correct it, or leave it out",
                   origin, key, stated, image, own, 100 * difference),
       {},
       {{"stated_mm", stated}, {"file_mm", own}}});
}

/// Sets the angle, or compares it with the image's own over whole turns.
void state_angle(std::optional<double>& own, std::optional<double> stated, const char* key,
                 const std::string& image, const std::string& origin) {
  constexpr double tolerance_deg = 1;
  if (!stated) return;
  if (own && std::abs(std::remainder(*stated - *own, 360)) > tolerance_deg)
    throw BadInput({Reason::bad_value,
                    fmt::format("{}: \"{}\" is {:g}, the image{} itself states {:g}, limit 1 degree; correct "
                                "it, or leave it out",
                                origin, key, *stated, image, *own),
                    {},
                    {{"stated_deg", *stated}, {"file_deg", *own}}});
  if (!own) own = stated;
}

/// Within the rounding of who wrote them.
bool agree(double a, double b) { return std::abs(a - b) <= 1e-3 * std::max(std::abs(a), std::abs(b)); }

/// Adds what another sidecar of the image states.
void add_agreeing(StatedGeometry& stated, const StatedGeometry& other, const std::string& name,
                  const std::string& other_name) {
  const auto add = [&](std::optional<double> StatedGeometry::*value, const char* key) {
    if (!(stated.*value)) stated.*value = other.*value;
    if (other.*value && !agree(*(stated.*value), *(other.*value)))
      throw BadInput({Reason::bad_value,
                      fmt::format("{}: \"{}\" is {:g}, {} states {:g}: correct one of them, or remove it",
                                  name, key, *(stated.*value), other_name, *(other.*value)),
                      {},
                      {{"value", *(stated.*value)}, {"other", *(other.*value)}}});
  };
  add(&StatedGeometry::pixel_mm, "pixel_mm");
  add(&StatedGeometry::source_detector_mm, "source_detector_mm");
  add(&StatedGeometry::primary_deg, "primary_deg");
  add(&StatedGeometry::secondary_deg, "secondary_deg");
}

}  // namespace

std::optional<fs::path> full_sidecar_of(const fs::path& image) {
  const fs::path name = full_name(image);
  return fs::exists(name) && !is_other_json(name) ? std::optional(name) : std::nullopt;
}

std::optional<fs::path> sidecar_of(const fs::path& image) {
  if (const auto full = full_sidecar_of(image)) return full;
  const fs::path name = short_name(image);
  return name != image && fs::exists(name) && !is_other_json(name) ? std::optional(name) : std::nullopt;
}

Expected<std::optional<std::pair<StatedGeometry, std::string>>> stated_beside(const fs::path& image,
                                                                              bool full_name_only) {
  return guarded([&]() -> std::optional<std::pair<StatedGeometry, std::string>> {
    const auto first = full_name_only ? full_sidecar_of(image) : sidecar_of(image);
    if (!first) return std::nullopt;
    StatedGeometry stated = value_or_throw(read_sidecar(*first));
    const std::string name = first->filename().string();
    const fs::path other = short_name(image);
    if (!full_name_only && other != *first && other != image && fs::exists(other) && !is_other_json(other))
      add_agreeing(stated, value_or_throw(read_sidecar(other)), name, other.filename().string());
    return std::pair(stated, name);
  });
}

std::optional<fs::path> other_json_of(const fs::path& image) {
  for (const fs::path& name : {full_name(image), short_name(image)})
    if (name != image && fs::exists(name) && is_other_json(name)) return name;
  return std::nullopt;
}

Expected<StatedGeometry> read_sidecar(const fs::path& path) {
  return guarded([&] {
    const Json json = value_or_throw(read_json(path));
    JsonReader reader(json, path.filename().string());
    StatedGeometry stated;
    stated.pixel_mm = reader.optional_number("pixel_mm", {min_pixel_mm, max_pixel_mm});
    stated.source_detector_mm =
        reader.optional_number("source_detector_mm", {min_source_detector_mm, max_source_detector_mm});
    stated.primary_deg = reader.optional_number("primary_deg", {-360, 360});
    stated.secondary_deg = reader.optional_number("secondary_deg", {-360, 360});
    reader.finish();
    if (stated.primary_deg.has_value() != stated.secondary_deg.has_value())
      reader.refuse(Reason::bad_value, stated.primary_deg ? "secondary_deg" : "primary_deg",
                    "is missing: the positioner's angles are stated together, 0 where it is not tilted");
    return stated;
  });
}

Expected<void> state_geometry(XrayImage& xray_image, const StatedGeometry& stated,
                              const std::string& origin) {
  return guarded([&] {
    Acquisition& acquisition = xray_image.acquisition;
    const std::string image = xray_image.name.empty() ? "" : fmt::format(" of {}", xray_image.name);
    if (stated.pixel_mm && acquisition.pixel_mm) {
      check_agreement(acquisition.pixel_mm->x(), *stated.pixel_mm, "pixel_mm", image, origin);
      check_agreement(acquisition.pixel_mm->y(), *stated.pixel_mm, "pixel_mm", image, origin);
    } else if (stated.pixel_mm) {
      acquisition.pixel_mm = Eigen::Vector2d::Constant(*stated.pixel_mm);
      std::erase_if(xray_image.warnings,
                    [](const Warning& warning) { return warning.reason == Reason::spacing_missing; });
    }
    if (stated.source_detector_mm && acquisition.source_detector_mm)
      check_agreement(*acquisition.source_detector_mm, *stated.source_detector_mm, "source_detector_mm",
                      image, origin);
    else if (stated.source_detector_mm)
      acquisition.source_detector_mm = stated.source_detector_mm;
    state_angle(acquisition.primary_angle_deg, stated.primary_deg, "primary_deg", image, origin);
    state_angle(acquisition.secondary_angle_deg, stated.secondary_deg, "secondary_deg", image, origin);
  });
}

}  // namespace helicarm::xray
