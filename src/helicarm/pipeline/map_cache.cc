// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/map_cache.h"

#include <algorithm>
#include <cstdlib>

#include <dlfcn.h>
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/private_files.h"
#include "helicarm/pipeline/view_image.h"
#include "helicarm/xray/digest.h"

namespace helicarm::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t most_image_bytes = std::uintmax_t{1} << 30, most_map_bytes = std::uintmax_t{1} << 26;
constexpr std::size_t most_kept = 256;
constexpr std::string_view kept_prefix = "map_", kept_ending = ".json";

/// Of this build of the program: another may fit another map.
std::string this_build() {
  Dl_info found{};
  std::error_code error;
  if (::dladdr(reinterpret_cast<const void*>(&user_cache_folder), &found) == 0) return HELICARM_VERSION;
  const auto size = fs::file_size(found.dli_fname, error);
  const auto time = fs::last_write_time(found.dli_fname, error);
  return fmt::format("{} {} {}", HELICARM_VERSION, size, time.time_since_epoch().count());
}

/// The pixel size and the distance may stand beside the file.
std::string map_name(const std::string& bytes, const xray::Acquisition& acquisition,
                     const phantom::Plate& plate, rectification::Method method) {
  const auto& pixel_mm = acquisition.pixel_mm;
  const auto& source_detector_mm = acquisition.source_detector_mm;
  const Json what{{"build", this_build()},
                  {"image", xray::digest(bytes)},
                  {"plate", phantom::to_json(plate)},
                  {"method", int(method)},
                  {"pixel_mm", pixel_mm ? Json{pixel_mm->x(), pixel_mm->y()} : Json()},
                  {"source_detector_mm", source_detector_mm ? Json(*source_detector_mm) : Json()}};
  return fmt::format("{}{}{}", kept_prefix, xray::digest(to_text(what)), kept_ending);
}

/// A file of `map_name`'s: the folder may hold others of its owner.
bool is_kept_map(const fs::directory_entry& entry) {
  static const std::size_t length = kept_prefix.size() + xray::digest("").size() + kept_ending.size();
  const std::string name = entry.path().filename().string();
  std::error_code ignored;
  return name.size() == length && name.starts_with(kept_prefix) && name.ends_with(kept_ending) &&
         name.find_first_not_of("0123456789abcdef", kept_prefix.size()) == length - kept_ending.size() &&
         entry.is_regular_file(ignored);
}

void forget_oldest(const fs::path& folder) {
  std::error_code error;
  std::vector<std::pair<fs::file_time_type, fs::path>> files;
  for (const auto& entry : fs::directory_iterator(folder, error))
    if (is_kept_map(entry)) files.emplace_back(entry.last_write_time(error), entry.path());
  if (files.size() <= most_kept) return;
  std::ranges::sort(files);
  for (std::size_t i = 0; i + most_kept < files.size(); ++i) fs::remove(files[i].second, error);
}

std::optional<rectification::DistortionMap> kept_map(const fs::path& file) {
  std::error_code error;
  if (!fs::exists(file, error)) return {};
  const auto map = read_file(file, most_map_bytes).and_then([&](const std::string& text) {
    return parse_json(text, file.string()).and_then([&](const Json& json) {
      return rectification::distortion_map_from_json(json, file.string());
    });
  });
  return map ? std::optional(*map) : std::nullopt;
}

}  // namespace

std::optional<fs::path> user_cache_folder() {
  for (const auto& [variable, inside] :
       {std::pair{"XDG_CACHE_HOME", "helicarm"}, {"HOME", ".cache/helicarm"}})
    if (const char* folder = std::getenv(variable); folder && fs::path(folder).is_absolute())
      return fs::path(folder) / inside;
  return {};
}

Expected<rectification::DistortionMap> plate_image_map(const CaseView& view, const phantom::Plate& plate,
                                                       rectification::Method method,
                                                       const std::optional<fs::path>& cache) {
  return guarded([&] {
    const xray::XrayImage image = value_or_throw(plate_image_of(view));
    std::optional<fs::path> file;
    if (cache)
      if (const auto bytes = read_file(*view.plate_image, most_image_bytes))
        file = *cache / map_name(*bytes, image.acquisition, plate, method);
    if (file)
      if (auto map = kept_map(*file)) return *std::move(map);
    rectification::DistortionMap map = value_or_throw(rectification::rectify(image, plate, {method, {}})).map;
    if (file && make_private_folder(*cache) &&
        write_private_file(*file, to_text(rectification::to_json(map))))
      forget_oldest(*cache);
    return map;
  });
}

}  // namespace helicarm::pipeline
