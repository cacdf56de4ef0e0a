// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/rotation.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/simulation/truth_json.h"
#include "helicarm/simulation/write_case.h"
#include "helicarm/xray/write_run.h"

namespace helicarm::simulation {
namespace {

Json displacement_json(const Displacement& displacement) {
  return {{"source", vector_json(displacement.source)}, {"detector", vector_json(displacement.detector)}};
}

xray::RunFrames run_frames(const SimulatedRun& run) {
  xray::RunFrames frames;
  const TrueView& first = run.images.views.front().true_view;
  for (const SimulatedView& view : run.images.views) {
    frames.angle_increments_deg.emplace_back(view.true_view.primary_angle_deg - first.primary_angle_deg,
                                             view.true_view.secondary_angle_deg - first.secondary_angle_deg);
    if (&view != &run.images.views.front()) frames.further.push_back(&view.pixels);
  }
  return frames;
}

}  // namespace

Eigen::Vector3d detector_in_calibrator(const TrueView& view) {
  const geometry::Intrinsics& k = view.view.intrinsics;
  const Eigen::Vector2d middle(0.5 * (view.detector.width - 1), 0.5 * (view.detector.height - 1));
  const Eigen::Vector2d in_camera = view.detector.pixel_mm * (middle - Eigen::Vector2d(k.u0, k.v0));
  return view.view.camera_from_world.inverse() * Eigen::Vector3d(in_camera.x(), in_camera.y(), view.f_mm);
}

Json case_json(const SimulatedRun& run) {
  Json json = case_json(run.images);
  json["views"] = Json::array({{{"name", "RUN"}, {"image", run_file}, {"frames", "all"}}});
  return json;
}

Json truth_json(const SimulatedRun& run) {
  Json json = truth_json(run.images);
  double largest = 0;
  for (std::size_t i = 0; i < run.deviations.size(); ++i) {
    const RunDeviation& deviation = run.deviations[i];
    const TrueView& view = run.images.views[i].true_view;
    Json& of_view = json["views"][i];
    of_view["frame"] = i + 1;
    of_view["source_mm"] = vector_json(view.view.source_in_world());
    of_view["detector_mm"] = vector_json(detector_in_calibrator(view));
    of_view["flex_mm"] = displacement_json(deviation.flex);
    of_view["jitter_mm"] = displacement_json(deviation.jitter);
    largest = std::max({largest, deviation.flex.source.norm(), deviation.flex.detector.norm()});
  }
  json["run"] = {{"file", run_file},
                 {"frames", run.rotation.frames},
                 {"arc_deg", run.rotation.arc_deg},
                 {"flex_mm", largest},
                 {"jitter_mm", run.rotation.jitter_mm}};
  return json;
}

Expected<void> write_run(const std::filesystem::path& folder, const SimulatedRun& run) {
  return guarded([&] {
    value_or_throw(check_case_folder(folder));
    const auto write_json = [&](const char* name, const Json& json) {
      value_or_throw(write_file(folder / name, to_text(json) + "\n"));
    };
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    forget_case(folder);
    // truth.json first: it marks the folder as a simulation if writing is interrupted.
    write_json("truth.json", truth_json(run));
    xray::DerivedImage first = dicom_of(run.images, 0);
    first.series_description = "RUN";
    value_or_throw(xray::write_run(folder / run_file, first, run_frames(run)));
    if (run.images.plate) write_json("plate.json", phantom::to_json(*run.images.plate));
    write_json("calibrator.json", phantom::to_json(run.images.calibrator));
    write_json("case.json", case_json(run));
  });
}

}  // namespace helicarm::simulation
