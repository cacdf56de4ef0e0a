// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/write_case.h"

#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/simulation/rotation.h"
#include "helicarm/simulation/streams.h"
#include "helicarm/simulation/truth_json.h"
#include "helicarm/xray/digest.h"
#include "helicarm/xray/uid.h"
#include "helicarm/xray/write_dicom.h"

namespace helicarm::simulation {
namespace {

constexpr const char* truth_file = "truth.json";
constexpr const char* plate_file = "plate.json";
constexpr const char* calibrator_file = "calibrator.json";
constexpr const char* case_file = "case.json";

/// From the pixels: a case is written identically each time, and different images have different UIDs.
std::string uid(const image::Image<std::uint16_t>& pixels, std::uint64_t item) {
  const auto values = pixels.pixels();
  const std::string content =
      xray::digest({reinterpret_cast<const char*>(values.data()), values.size_bytes()});
  RandomStream random(std::stoull(content.substr(0, 16), nullptr, 16), stream::uids, item);
  return xray::make_uid(random);
}

/// Of both bones and one more marker.
Json poses_json(const NavigationTruth& truth, const std::string& marker) {
  const auto pose = [&](const std::string& frame) { return matrix_json(truth.read.at(frame).matrix()); };
  return {{"tracker_from_" + marker, pose(marker)},
          {"tracker_from_bone", {{"femur", pose("femur")}, {"tibia", pose("tibia")}}}};
}

void add_navigation(Json& json, const SimulatedCase& simulated) {
  const NavigationTruth& truth = *simulated.navigation;
  for (Json& view : json["views"]) view["poses"] = poses_json(truth, "calibrator");
  json["poses_now"] = poses_json(truth, "tool");
  json["tracker"] = {{"sigma_mm", truth.sigma_mm}, {"sigma_deg", truth.sigma_deg}, {"samples", "shared"}};
  for (const SimulatedView& view : simulated.views)
    for (std::size_t i = 0; i < view.clicks.size(); ++i)
      json["picks"].push_back({{"name", view.clicks[i].point},
                               {"view", view.true_view.name},
                               {"uv", vector_json(view.clicks[i].raw)},
                               {"snap", "ball"},
                               {"diameter_mm", tunnel_ball_mm},
                               {"moves_with", truth.points[i].bone}});
  for (const TrueToolLine& line : truth.lines) {
    json["tunnels"].push_back({{"name", line.name}, {"start", line.start}, {"end", line.end}});
    json["tool_lines"].push_back({{"name", line.name},
                                  {"tunnel", line.name},
                                  {"p1_in_calibrator", vector_json(line.p1_in_calibrator)},
                                  {"p2_in_calibrator", vector_json(line.p2_in_calibrator)}});
  }
}

Expected<void> write_json(const std::filesystem::path& path, const Json& json) {
  return write_file(path, to_text(json) + "\n");
}

}  // namespace

void forget_case(const std::filesystem::path& folder) {
  const auto truth = read_json(folder / truth_file);
  if (!truth) return;
  std::error_code ignored;
  for (const char* file : {plate_file, calibrator_file, case_file})
    std::filesystem::remove(folder / file, ignored);
  if (truth->is_object() && truth->contains("run")) std::filesystem::remove(folder / run_file, ignored);
  const Json views = truth->value("views", Json::array());
  for (const Json& view : views) {
    if (!view.is_object() || !view.contains("name") || !view["name"].is_string()) continue;
    const std::filesystem::path file = view["name"].get<std::string>() + ".dcm";
    if (file == file.filename()) std::filesystem::remove(folder / file, ignored);
  }
  std::filesystem::remove(folder / truth_file, ignored);
}

xray::DerivedImage dicom_of(const SimulatedCase& simulated, std::size_t number) {
  const SimulatedView& view = simulated.views[number];
  const TrueView& true_view = view.true_view;
  xray::DerivedImage image;
  image.pixels = view.pixels;
  image.bits_stored = simulated.options.bits;
  image.acquisition.pixel_mm = Eigen::Vector2d::Constant(true_view.detector.pixel_mm);
  image.acquisition.source_detector_mm = true_view.nominal_f_mm;
  image.acquisition.primary_angle_deg = true_view.primary_angle_deg;
  image.acquisition.secondary_angle_deg = true_view.secondary_angle_deg;
  image.acquisition.flip_hint = true_view.mirrored;
  image.acquisition.logarithmic = true_view.imaging.logarithmic;
  image.log_range = -std::log(floor_signal);
  image.acquisition.modality = "XA";
  image.derived = false;
  image.series_description = true_view.name;
  image.patient_name = "SIMULATED";
  image.patient_id = fmt::format("SIM{}", simulated.options.seed);
  image.study_uid = uid(simulated.views.front().pixels, 0);
  image.series_uid = uid(view.pixels, 1);
  image.instance_uid = uid(view.pixels, 2);
  return image;
}

Json case_json(const SimulatedCase& simulated) {
  Json json = {{"format", "helicarm-case/2"},
               {"calibrator", calibrator_file},
               {"plate", simulated.plate ? Json(plate_file) : Json(nullptr)},
               {"views", Json::array()}};
  for (const SimulatedView& view : simulated.views)
    json["views"].push_back({{"name", view.true_view.name}, {"image", view.true_view.name + ".dcm"}});
  if (simulated.navigation) add_navigation(json, simulated);
  return json;
}

Expected<void> check_case_folder(const std::filesystem::path& folder) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (!fs::exists(folder, error)) return {};
  if (!fs::is_directory(folder, error))
    return fail(Reason::cannot_write, fmt::format("{}: is not a folder", folder.string()));
  if (fs::is_empty(folder, error)) return {};
  const auto truth = read_json(folder / truth_file);
  if (truth && truth->is_object() && truth->value("format", Json()) == "helicarm-truth/1") return {};
  return fail(Reason::cannot_write,
              fmt::format("{}: contains files other than an earlier simulation; choose an empty folder",
                          folder.string()));
}

Expected<void> write_case(const std::filesystem::path& folder, const SimulatedCase& simulated) {
  if (auto free = check_case_folder(folder); !free) return free;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return fail(Reason::cannot_write, fmt::format("{}: {}", folder.string(), error.message()));
  return guarded([&] {
    forget_case(folder);
    // truth.json first: it marks the folder as a simulation if writing is interrupted.
    value_or_throw(write_json(folder / truth_file, truth_json(simulated)));
    for (std::size_t i = 0; i < simulated.views.size(); ++i)
      value_or_throw(
          xray::write_dicom(folder / (simulated.views[i].true_view.name + ".dcm"), dicom_of(simulated, i)));
    if (simulated.plate) value_or_throw(write_json(folder / plate_file, phantom::to_json(*simulated.plate)));
    if (simulated.options.kind == CaseKind::grid) return;
    value_or_throw(write_json(folder / calibrator_file, phantom::to_json(simulated.calibrator)));
    value_or_throw(write_json(folder / case_file, case_json(simulated)));
  });
}

}  // namespace helicarm::simulation
