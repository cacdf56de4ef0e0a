// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <set>
#include <variant>

#include "arrays.h"
#include "checks.h"
#include "helicarm/case_registration/bone_checks.h"
#include "helicarm/case_registration/register_in_memory.h"
#include "helicarm/core/files.h"
#include "helicarm/guidance/bone_check_description.h"
#include "helicarm/guidance/tunnel.h"
#include "helicarm/pipeline/model_description.h"
#include "helicarm/rectification/rectify.h"
#include "helicarm/registration/model.h"
#include "helicarm/report/earlier_results.h"
#include "helicarm/sweep/sweep.h"
#include "helicarm/volume/hounsfield.h"
#include "helicarm/xray/image_file.h"
#include "measuring_options.h"
#include "module.h"
#include "run_sweep.h"
#include "signals.h"

namespace helicarm::python {
namespace {

using Camera = exchange::ImportedMatrix;
using VolumePointer = std::shared_ptr<volume::Volume>;
using SurfacePointer = std::shared_ptr<registration::SurfaceMesh>;
using ImagePointer = std::shared_ptr<xray::XrayImage>;
/// Name, image, camera, and the map of a raw image.
using GivenView = std::tuple<std::string, ImagePointer, Camera, std::optional<rectification::DistortionMap>>;

geometry::RigidTransform pose_from(const Doubles& matrix, const std::string& name) {
  constexpr double rounded = 1e-6;
  const Eigen::Matrix4d stated = matrix_of(matrix, 4, 4, name);
  const geometry::RigidTransform pose{stated.topLeftCorner<3, 3>(), stated.topRightCorner<3, 1>()};
  if (stated.row(3) != Eigen::RowVector4d(0, 0, 0, 1) ||
      !(pose.rotation * pose.rotation.transpose()).isIdentity(rounded) || pose.rotation.determinant() < 0)
    raise({Reason::bad_value, fmt::format("{}: is not a rigid motion (4 x 4, mm)", name), {}, {}});
  return pose;
}

/// A value of a model's mapping.
template <class T>
T entry(const py::dict& entries, const char* key, const std::string& model, const char* form) {
  try {
    return entries[key].cast<T>();
  } catch (const py::cast_error&) {
    raise({Reason::bad_value,
           fmt::format("{}: {}: {} is not {}", model, key, std::string(py::repr(entries[key])), form),
           {},
           {}});
  }
}

struct GivenVolume {
  VolumePointer volume;
  std::optional<volume::Volume> mask = {};
  std::optional<registration::HuWindow> window = {};
};

GivenVolume volume_in(const py::dict& entries, const std::string& name) {
  GivenVolume given{entries["volume"].cast<VolumePointer>()};
  if (entries.contains("mask")) given.mask = *entries["mask"].cast<VolumePointer>();
  if (entries.contains("window_hu")) {
    const auto [low, high] = entry<std::pair<double, double>>(entries, "window_hu", name, "(low, high)");
    checked(low, any_number, name + ": window_hu");
    checked(high, {low, std::numeric_limits<double>::infinity(), true}, name + ": window_hu");
    given.window = registration::HuWindow{low, high};
  }
  return given;
}

case_registration::GivenModel model_of(const std::string& name, const py::dict& entries,
                                       const std::vector<Doubles>& starts) {
  case_registration::GivenModel loaded;
  if (entries.contains("surface")) {
    const auto surface = entries["surface"].cast<SurfacePointer>();
    loaded.model = value_or_raise(without_gil([&] { return registration::model_from(name, *surface); }));
    loaded.model.warnings = surface->warnings;
  } else {
    const auto [held, mask, window] = volume_in(entries, name);
    loaded.model = value_or_raise(without_gil([&, &held = held, &mask = mask, &window = window] {
      return registration::model_from(name, *held, mask, window);
    }));
    loaded.model.warnings = held->warnings;
    for (Warning& warning : value_or_raise(volume::check_hounsfield(*held, name + ": volume")))
      loaded.model.warnings.push_back(std::move(warning));
    if (mask)
      loaded.model.warnings.insert(loaded.model.warnings.end(), mask->warnings.begin(), mask->warnings.end());
  }
  if (entries.contains("scale_sigma"))
    loaded.scale_sigma =
        checked(entry<double>(entries, "scale_sigma", name, "a number"), {0, 0.1}, name + ": scale_sigma");
  if (entries.contains("points"))
    for (const auto& [point, at] : entries["points"].cast<std::vector<std::pair<std::string, Doubles>>>())
      loaded.points.push_back({point, row_of<3>(at, fmt::format("{}: points: {}", name, point))});
  for (const Doubles& start : starts) loaded.starts.push_back(pose_from(start, "starts: " + name));
  return loaded;
}

case_registration::LoadedViews views_of(const std::vector<GivenView>& views,
                                        const std::optional<Doubles>& camera_covariance,
                                        const std::vector<std::optional<py::array_t<bool>>>& usable) {
  std::vector<xray::XrayImage> images;
  std::vector<Camera> cameras;
  for (const auto& [name, image, camera, map] : views) {
    images.push_back(*image);
    images.back().name = name;
    if (map) images.back().pixels = rectification::resample(*image, *map);
    cameras.push_back(camera);
  }
  auto loaded = value_or_raise(case_registration::views_of_images(std::move(images), cameras));
  const auto size = py::ssize_t(calibration::view_parameters * views.size());
  if (camera_covariance)
    loaded.camera_covariance = checked_covariance(
        matrix_of(*camera_covariance, size, size, "camera_covariance"), "camera_covariance");
  for (std::size_t i = 0; i < usable.size(); ++i) {
    if (!usable[i]) continue;
    auto& view = loaded.views[i];
    const py::array_t<bool> mask = py::array_t<bool, py::array::c_style>::ensure(*usable[i]);
    if (mask.ndim() != 2 || mask.shape(0) != view.grey.height() || mask.shape(1) != view.grey.width())
      raise({Reason::bad_size,
             fmt::format("usable: shape {}, the image has ({}, {})", shape_of(mask), view.grey.height(),
                         view.grey.width()),
             view.name,
             {}});
    view.usable = image::Image<std::uint8_t>(view.grey.width(), view.grey.height());
    std::ranges::copy_n(mask.data(), mask.size(), view.usable.pixels().begin());
  }
  return loaded;
}

py::object register_given(const std::vector<std::pair<std::string, py::dict>>& models,
                          const std::map<std::string, std::vector<Doubles>>& starts,
                          const std::vector<GivenView>& views,
                          const std::optional<Doubles>& camera_covariance,
                          const std::vector<std::optional<py::array_t<bool>>>& usable,
                          const std::optional<std::filesystem::path>& out, std::optional<double> max_error_mm,
                          double motion_sigma_mm, double search_mm, double search_deg, unsigned threads,
                          const py::object& progress) {
  const auto options = measuring_options("register", "best", max_error_mm, motion_sigma_mm, search_mm,
                                         search_deg, threads, {}, py::bool_(false));
  if (out) value_or_raise(check_can_write(*out));
  if (out) report::forget_registration(*out);
  std::vector<case_registration::GivenModel> loaded_models;
  for (const auto& [name, model] : models) {
    const auto at = starts.find(name);
    loaded_models.push_back(model_of(name, model, at == starts.end() ? std::vector<Doubles>{} : at->second));
  }
  auto loaded = views_of(views, camera_covariance, usable);
  const RunHooks hooks = run_hooks(progress);
  const auto result = value_or_raise(without_gil([&] {
    return case_registration::register_given(std::move(loaded_models), std::move(loaded), options,
                                             progress_of(hooks))
        .and_then([&](case_registration::CaseRegistration registered) {
          const auto written =
              out ? case_registration::write_registration(registered, *out) : Expected<void>{};
          return written.map([&] { return std::move(registered); });
        });
  }));
  py::object answer = python_from(case_registration::to_json(result));
  for (const case_registration::RegisteredModel& model : result.models)
    if (model.registration.failure) raise(*model.registration.failure, answer);
  return answer;
}

/// Name, start and end, diameter, required bridge.
using GivenTunnel = std::tuple<std::string, Doubles, double, std::optional<double>>;

py::dict check_tunnels(const py::dict& entries, const std::vector<GivenTunnel>& tunnels) {
  case_registration::MarkupPlan plan;
  for (const auto& [name, ends, diameter_mm, bridge_mm] : tunnels) {
    const std::vector<Eigen::Vector3d> points = rows_of<3>(ends, name);
    if (points.size() != 2) raise({Reason::bad_value, name + ": is not a start and an end", {}, {}});
    if ((points[1] - points[0]).norm() < guidance::shortest_tunnel_mm)
      raise({Reason::bad_value,
             fmt::format("{}: is shorter than {:g} mm", name, guidance::shortest_tunnel_mm),
             {},
             {}});
    plan.tunnels.push_back(
        {name, plan.points.size(), plan.points.size() + 1,
         checked(diameter_mm, within(pipeline::description::tunnel_diameter_mm), name + ": diameter_mm"),
         checked(bridge_mm.value_or(pipeline::usual_bridge_mm),
                 within(pipeline::description::tunnel_bridge_mm), name + ": bridge_mm")});
    plan.points.push_back({name + "_start", points[0]});
    plan.points.push_back({name + "_end", points[1]});
  }
  const registration::Model model = model_of("model", entries, {}).model;
  std::shared_ptr<const registration::BoneSurface> bone;
  if (model.surface) {
    bone = without_gil([&] { return registration::bone_surface(*model.surface, model.voxel_mm); });
  } else {
    const GivenVolume given = volume_in(entries, "model");
    if (!given.mask && !given.window)
      raise({Reason::usage,
             "a volume needs a \"mask\" or \"window_hu\": without one it has no outline",
             {},
             {}});
    bone = without_gil([&] { return registration::bone_surface(*given.volume, given.mask, given.window); });
  }
  const auto checks = without_gil([&] { return case_registration::bone_checks(plan, bone.get()); });
  py::dict answer;
  for (std::size_t i = 0; i < checks.size(); ++i)
    answer[py::str(plan.tunnels[i].name)] = python_from(
        output_of([&](OutputJson& output) { guidance::describe_bone_check(output, *checks[i]); }));
  return answer;
}

sweep::Sweep sweep_images(const std::vector<ImagePointer>& images, const phantom::Calibrator& calibrator,
                          const std::optional<phantom::Plate>& plate, std::optional<bool> mirrored,
                          const std::optional<std::string>& path, const std::optional<std::string>& check,
                          const std::optional<std::array<std::array<double, 3>, 2>>& wire,
                          const std::optional<std::filesystem::path>& against, unsigned threads,
                          const py::object& progress) {
  constexpr std::size_t most_images = 1000;
  if (images.empty() || images.size() > most_images)
    raise({Reason::bad_value,
           fmt::format("images: {} images, 1 to {} are possible", images.size(), most_images),
           {},
           {}});
  sweep::SweepCase the_case;
  the_case.base.calibrator = calibrator;
  the_case.base.calibrator_name = calibrator.name;
  the_case.base.plate = plate;
  if (plate) the_case.base.plate_name = plate->name;
  pipeline::CaseView run;
  run.name = "RUN";
  run.image = "images";
  run.mirrored = mirrored;
  the_case.base.views = {run};
  std::vector<xray::XrayImage> frames;
  for (std::size_t i = 0; i < images.size(); ++i) {
    frames.push_back(*images[i]);
    sweep::Frame frame{run, run.name, int(i) + 1};
    frame.view.name = fmt::format("{}/{}", run.name, frame.number);
    frame.view.frame = frame.number;
    the_case.frames.push_back(std::move(frame));
  }
  the_case.files[run.image] = value_or_raise(xray::ImageFile::of(std::move(frames)));
  return run_sweep([&] { return Expected<sweep::SweepCase>(std::move(the_case)); }, path,
                   check_options(check, wire, against, threads), threads, progress);
}

}  // namespace

void add_in_memory(py::module_& module) {
  const case_registration::RegisterOptions usual;
  module.def("_register_given", &register_given, py::arg("models"), py::arg("starts"), py::arg("views"),
             py::arg("camera_covariance"), py::arg("usable"), py::kw_only(), py::arg("out") = py::none(),
             py::arg("max_error_mm") = py::none(), py::arg("motion_sigma_mm") = usual.run.motion_sigma_mm,
             py::arg("search_mm") = usual.search.shift_mm, py::arg("search_deg") = usual.search.turn_deg,
             py::arg("threads") = usual.run.threads, py::arg("progress") = py::none());
  module.def("_check_tunnels", &check_tunnels, py::arg("model"), py::arg("tunnels"));
  const sweep::SweepOptions free;
  module.def("_sweep_images", &sweep_images, py::arg("images"), py::arg("calibrator"), py::arg("plate"),
             py::arg("mirrored"), py::kw_only(), py::arg("path") = py::none(), py::arg("check") = py::none(),
             py::arg("wire") = py::none(), py::arg("against") = py::none(), py::arg("threads") = free.threads,
             py::arg("progress") = py::none());
}

}  // namespace helicarm::python
