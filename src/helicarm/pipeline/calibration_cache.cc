// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/calibration_cache.h"

#include "helicarm/core/files.h"
#include "helicarm/pipeline/stopwatch.h"
#include "helicarm/xray/digest.h"
#include "helicarm/xray/sidecar.h"

namespace helicarm::pipeline {
namespace {

constexpr std::uintmax_t most_file_bytes = std::uintmax_t{256} << 20;

Expected<std::string> digest_of(const std::filesystem::path& file) {
  return read_file(file, most_file_bytes).map([](const std::string& bytes) { return xray::digest(bytes); });
}

/// Contents of all inputs of a case's calibration.
Expected<std::string> key_of(const Case& given, rectification::Method method) {
  Json key = {{"calibrator", phantom::to_json(given.calibrator)},
              {"plate", given.plate ? phantom::to_json(*given.plate) : Json()},
              {"paper", method == rectification::Method::paper},
              {"views", Json::array()}};
  for (const CaseView& view : given.views) {
    Json files = Json::array();
    for (const auto& file :
         {std::optional(view.image), xray::sidecar_of(view.image), view.plate_image,
          view.plate_image ? xray::sidecar_of(*view.plate_image) : std::nullopt, view.map}) {
      const auto content = file ? digest_of(*file) : Expected<std::string>();
      if (!content) return tl::unexpected<Failure>(content.error());
      files.push_back(*content);
    }
    key["views"].push_back({{"name", view.name},
                            {"frame", view.frame.value_or(0)},
                            {"mirrored", view.mirrored ? Json(*view.mirrored) : Json()},
                            {"pixel_mm", view.pixel_mm.value_or(0)},
                            {"source_detector_mm", view.source_detector_mm.value_or(0)},
                            {"files", files}});
  }
  return to_text(key);
}

}  // namespace

Expected<Result> CalibrationCache::run(const Case& given, const RunOptions& options) {
  std::optional<double> total;
  auto result = timed(total, [&]() -> Expected<Result> {
    auto key = key_of(given, options.method);
    if (!key) return tl::unexpected<Failure>(key.error());
    if (!held_ || key_ != *key) {
      held_.reset();
      ++calibrations_;
      auto calibration = calibrate_case(given, options);
      if (!calibration) return result_of_refusal(given, std::move(calibration).error(), options);
      held_ = *std::move(calibration);
      key_ = *std::move(key);
    }
    return locate_case(given, *held_, options);
  });
  if (result) result->timing_ms.total = total;
  return result;
}

}  // namespace helicarm::pipeline
