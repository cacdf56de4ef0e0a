// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/load.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "helicarm/calibration/centred_view.h"
#include "helicarm/case_registration/bone_checks.h"
#include "helicarm/case_registration/register_in_memory.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/pipeline/case_frames.h"
#include "helicarm/pipeline/view_image.h"
#include "helicarm/rectification/rectify.h"
#include "helicarm/volume/hounsfield.h"
#include "helicarm/volume/label_map.h"
#include "helicarm/volume/read_volume.h"
#include "helicarm/volume/tiff_stack.h"

namespace helicarm::case_registration {
namespace {

namespace fs = std::filesystem;
using registration::RegistrationView;

RegistrationView view_of(const xray::XrayImage& image, const std::string& name, const geometry::View& view) {
  RegistrationView made;
  made.name = name;
  made.view = view;
  made.lowest = image.lowest;
  made.highest = image.highest;
  made.logarithmic = image.acquisition.logarithmic.value_or(false);
  return made;
}

void mask_disc(image::Image<std::uint8_t>& usable, const Eigen::Vector2d& at, double radius) {
  const int reach = int(std::ceil(radius));
  const int u0 = int(std::lround(at.x())), v0 = int(std::lround(at.y()));
  for (int v = v0 - reach; v <= v0 + reach; ++v)
    for (int u = u0 - reach; u <= u0 + reach; ++u)
      if (usable.contains(u, v) && (Eigen::Vector2d(u, v) - at).norm() <= radius) usable(u, v) = 0;
}

constexpr double mask_margin_px = 3;

/// Discs around the plate dots, fiducials and check targets.
image::Image<std::uint8_t> usable_of(const pipeline::LabelledView& view,
                                     const phantom::Calibrator& calibrator, const geometry::View& camera) {
  const auto& pixels = view.xray_image->pixels;
  image::Image<std::uint8_t> usable(pixels.width(), pixels.height(), 1);
  const rectification::Rectification& rectification = view.rectification;
  const auto mask_raw = [&](const detection::Dot& dot) {
    if (const auto at = rectification.map.rectified_from_raw(dot.centre_px))
      mask_disc(usable, *at, dot.radius_px + mask_margin_px);
  };
  for (const detection::Dot& dot : rectification.plate_dots) mask_raw(dot);
  for (const phantom::CalibratorBall& ball : calibrator.balls) {
    if (!(camera.depth(ball.centre_in_calibrator) > 1)) continue;
    const double px_per_mm = std::abs(camera.intrinsics.fy) / camera.depth(ball.centre_in_calibrator);
    mask_disc(usable, camera.project(ball.centre_in_calibrator),
              ball.diameter_mm / 2 * px_per_mm + mask_margin_px);
  }
  for (const phantom::CalibratorTarget& target : calibrator.targets) {
    if (!(camera.depth(target.point_in_calibrator) > 1)) continue;
    const double px_per_mm = std::abs(camera.intrinsics.fy) / camera.depth(target.point_in_calibrator);
    mask_disc(usable, camera.project(target.point_in_calibrator),
              3 * target.diameter_mm * px_per_mm + mask_margin_px);
  }
  return usable;
}

volume::Volume volume_at(const fs::path& path, const pipeline::CaseModel& case_model, double offset_hu) {
  if (!volume::is_tiff_stack(path)) return value_or_throw(volume::read_volume(path));
  if (!case_model.voxel_mm)
    throw BadInput(
        Reason::bad_value,
        fmt::format("models: \"{}\": \"voxel_mm\" is missing: a TIFF stack needs it", case_model.name));
  return value_or_throw(volume::tiff_stack(path, *case_model.voxel_mm, offset_hu));
}

/// The body's mask, 0 outside, and whether slices without it may be missing (a DICOM segmentation).
struct LoadedMask {
  volume::Volume volume;
  bool may_be_part = false;
};

/// `key`: of the mask in its case.
LoadedMask mask_of(const pipeline::CaseModel& case_model, const pipeline::CaseMask& mask,
                   const std::string& key) {
  const fs::path& file = *mask.file;
  const std::string origin = fmt::format("models: \"{}\": {}", case_model.name, file.filename().string());
  std::optional<volume::Volume> segment =
      value_or_throw(volume::read_segment(file, {mask.label, mask.segment, mask.threshold, key}));
  if (segment) return {*std::move(segment), true};
  if (mask.segment)
    throw BadInput(Reason::bad_value,
                   fmt::format("{} is no DICOM segmentation: it takes no \"{}_segment\"", origin, key));
  LoadedMask loaded{volume_at(file, case_model, 0)};
  value_or_throw(volume::choose_mask(loaded.volume, mask.label, mask.threshold, origin, key));
  return loaded;
}

/// The mask, if there is one, on the CT's grid; another grid is refused (bad_value).
std::optional<volume::Volume> mask_on(const volume::Volume& ct, const pipeline::CaseModel& case_model,
                                      const pipeline::CaseMask& mask, const std::string& key) {
  if (!mask.file) return std::nullopt;
  LoadedMask loaded = mask_of(case_model, mask, key);
  // A stack has no frame of its own: a mask drawn on it in another program brings that program's.
  if (case_model.voxel_mm && volume::has_spacing(loaded.volume, *case_model.voxel_mm))
    loaded.volume.patient_from_voxel = ct.patient_from_voxel;
  // A segmentation's empty slices may be missing.
  volume::onto_grid(loaded.volume, ct, loaded.may_be_part);
  value_or_throw(registration::check_mask(fmt::format("{}: {}", case_model.name, key), ct, loaded.volume));
  return std::move(loaded.volume);
}

void check_size(const std::string& view, const char* expected_by, const Eigen::Vector2i& expected,
                const image::Image<float>& image) {
  if (expected != Eigen::Vector2i(image.width(), image.height()))
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} {} x {} pixels, the image has {} x {}", view, expected_by,
                               expected.x(), expected.y(), image.width(), image.height()));
}

/// Refuses an image of another patient; `known`: the key so far.
void take_patient(std::string& known, const xray::XrayImage& image) {
  const std::string& key = image.acquisition.patient_key;
  if (known.empty()) known = key;
  if (!key.empty() && key != known)
    throw BadInput(Reason::patient_mismatch,
                   fmt::format("{} is of another patient than the images before it", image.name));
}

void refuse_sequence(const pipeline::Case& the_case) {
  if (pipeline::is_sequence(the_case))
    throw BadInput(Reason::bad_value,
                   "views: \"image\" holds {frame}: name the frames with --frames, such as --frames 1-100");
}

/// With an image whose camera another program brought: free of distortion, or with a map to its pixels.
void add_view(pipeline::CaseCalibration& taken, xray::XrayImage image, const exchange::ImportedMatrix& camera,
              std::optional<rectification::DistortionMap> map = {}) {
  std::string patient;
  for (const pipeline::LabelledView& before : taken.images) take_patient(patient, *before.xray_image);
  take_patient(patient, image);
  if (camera.image_size) check_size(image.name, "the camera is for", *camera.image_size, image.pixels);
  if (map) check_size(image.name, "\"map\" is for", {map->width, map->height}, image.pixels);
  // The camera states what the pixels measure.
  std::ranges::copy_if(image.warnings, std::back_inserter(taken.warnings),
                       [](const Warning& warning) { return warning.reason != Reason::spacing_missing; });
  pipeline::LabelledView& view = taken.images.emplace_back();
  view.name = image.name;
  view.rectification.source = map ? rectification::MapSource::file : rectification::MapSource::none;
  view.rectification.map = map ? *std::move(map) : rectification::flat_panel_map(image);
  taken.views.push_back({view.name, camera.view, {}});
  taken.fiducials.emplace_back();
  view.xray_image = std::make_shared<const xray::XrayImage>(std::move(image));
}

LoadedViews views_of_cameras(const pipeline::CaseCalibration& taken) {
  LoadedViews loaded;
  for (std::size_t i = 0; i < taken.views.size(); ++i) {
    const xray::XrayImage& image = *taken.images[i].xray_image;
    const rectification::Rectification& rectification = taken.images[i].rectification;
    if (loaded.patient_key.empty()) loaded.patient_key = image.acquisition.patient_key;
    loaded.views.push_back(view_of(image, taken.views[i].name, taken.views[i].view));
    loaded.views.back().grey = rectification::resample(image, rectification.map);
    const bool has_map = rectification.source == rectification::MapSource::file;
    loaded.maps.push_back(has_map ? std::optional(rectification.map) : std::nullopt);
    if (image.inverted) loaded.inverted.push_back(*image.inverted);
  }
  loaded.warnings = taken.warnings;
  return loaded;
}

/// Of views that were calibrated each alone and without weights: s^2 (J^T J)^-1, where s^2 is the variance of
/// the view's residuals per axis and J the derivative of its fiducials' pixels.
Eigen::MatrixXd covariance_by_residuals(const pipeline::CaseCalibration& calibration) {
  constexpr Eigen::Index each = calibration::view_parameters;
  const auto n = Eigen::Index(calibration.views.size());
  Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(each * n, each * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(each, each);
    double squares = 0;
    int used = 0;
    for (const fiducials::Fiducial& ball : calibration.fiducials[std::size_t(i)]) {
      if (ball.status != fiducials::FiducialStatus::used) continue;
      const geometry::View& view = calibration.views[std::size_t(i)].view;
      const auto slope = calibration::pixel_by_parameters(view, ball.centre_in_calibrator);
      information += slope.transpose() * slope;
      squares += ball.residual_px * ball.residual_px;
      ++used;
    }
    const double variance = squares / std::max(1, 2 * used - int(each));
    joint.block(each * i, each * i, each, each) =
        variance * geometry::solve_spd(information, Eigen::MatrixXd::Identity(each, each)).solution;
  }
  return joint;
}

}  // namespace

Expected<pipeline::CaseCalibration> calibration_of_cameras(const pipeline::Case& the_case) {
  return guarded([&] {
    refuse_sequence(the_case);
    pipeline::CaseCalibration taken;
    for (const pipeline::CaseView& view : the_case.views) {
      std::optional<rectification::DistortionMap> map;
      if (view.map)
        map = value_or_throw(rectification::distortion_map_from_json(value_or_throw(read_json(*view.map)),
                                                                     view.map->filename().string()));
      add_view(taken, value_or_throw(pipeline::image_of(view)),
               value_or_throw(exchange::import_matrix(*view.camera)), std::move(map));
    }
    return taken;
  });
}

LoadedViews views_of_calibration(const pipeline::Case& the_case,
                                 const pipeline::CaseCalibration& calibration) {
  if (pipeline::brings_cameras(the_case)) return views_of_cameras(calibration);
  LoadedViews loaded;
  for (std::size_t i = 0; i < calibration.views.size(); ++i) {
    const pipeline::LabelledView& image = calibration.images[i];
    const calibration::CalibratedView& view = calibration.views[i];
    if (loaded.patient_key.empty()) loaded.patient_key = image.xray_image->acquisition.patient_key;
    loaded.views.push_back(view_of(*image.xray_image, view.name, view.view));
    loaded.views.back().grey = rectification::resample(*image.xray_image, image.rectification.map);
    loaded.views.back().usable = usable_of(image, the_case.calibrator, view.view);
    loaded.maps.emplace_back(image.rectification.map);
  }
  loaded.camera_covariance = calibration.joint_covariance.size() > 0 ? calibration.joint_covariance
                                                                     : covariance_by_residuals(calibration);
  loaded.warnings = calibration.warnings;
  return loaded;
}

Expected<LoadedViews> load_views(const pipeline::Case& the_case, const pipeline::RunOptions& run,
                                 const pipeline::Progress& progress) {
  return guarded([&] {
    refuse_sequence(the_case);
    if (pipeline::brings_cameras(the_case)) {
      progress.begin("read");
      return views_of_cameras(value_or_throw(calibration_of_cameras(the_case)));
    }
    const auto calibration = pipeline::calibrate_case(the_case, run, progress);
    if (!calibration) throw BadInput(calibration.error().failure);
    return views_of_calibration(the_case, *calibration);
  });
}

Expected<LoadedViews> views_of_images(std::vector<xray::XrayImage> images,
                                      const std::vector<exchange::ImportedMatrix>& cameras) {
  return guarded([&] {
    pipeline::CaseCalibration taken;
    for (std::size_t i = 0; i < images.size(); ++i) add_view(taken, std::move(images[i]), cameras[i]);
    return views_of_cameras(taken);
  });
}

Expected<std::vector<RegistrationView>> with_images(const LoadedViews& loaded,
                                                    const std::vector<xray::XrayImage>& images) {
  return guarded([&] {
    std::vector<RegistrationView> views = loaded.views;
    for (std::size_t i = 0; i < views.size(); ++i) {
      const xray::XrayImage& image = images[i];
      std::string patient = loaded.patient_key;
      take_patient(patient, image);
      check_size(views[i].name, "the sequence's first image has",
                 {views[i].grey.width(), views[i].grey.height()}, image.pixels);
      RegistrationView now = view_of(image, views[i].name, views[i].view);
      now.grey = loaded.maps[i] ? rectification::resample(image, *loaded.maps[i]) : image.pixels;
      now.usable = std::move(views[i].usable);
      views[i] = std::move(now);
    }
    return views;
  });
}

Expected<volume::Volume> volume_of(const pipeline::CaseModel& case_model) {
  return guarded([&] { return volume_at(case_model.volume.value(), case_model, case_model.tiff_offset_hu); });
}

Expected<std::vector<std::uint8_t>> body_in(const volume::Volume& ct, const pipeline::CaseModel& case_model) {
  return guarded([&] {
    const auto mask = mask_on(ct, case_model, case_model.mask, "mask");
    std::vector<std::uint8_t> body;
    if (!mask && !case_model.window_hu) return body;
    body.reserve(ct.voxels.size());
    if (mask)
      for (const float voxel : mask->voxels) body.push_back(voxel != 0);
    else
      for (const float voxel : ct.voxels) body.push_back(voxel >= case_model.window_hu->x());
    return body;
  });
}

Expected<LoadedModel> load_model(const pipeline::CaseModel& case_model,
                                 const std::optional<MarkupPlan>& plan) {
  return guarded([&]() -> LoadedModel {
    const bool has_tunnels = plan && !plan->tunnels.empty();
    LoadedModel loaded;
    const auto compare = [&](const registration::BoneSurface& bone, const volume::Volume* ct) {
      loaded.bone_checks = bone_checks(*plan, &bone);
      loaded.tunnel_slices = tunnel_slices(*plan, loaded.bone_checks, bone, ct);
    };
    if (case_model.surface) {
      registration::SurfaceMesh surface = value_or_throw(registration::read_surface(*case_model.surface));
      registration::Model model = value_or_throw(registration::model_from(case_model.name, surface));
      model.warnings = std::move(surface.warnings);
      if (has_tunnels) compare(*registration::bone_surface(*model.surface, model.voxel_mm), nullptr);
      loaded.model = std::move(model);
      return loaded;
    }
    if (!case_model.volume) return loaded;
    if ((case_model.voxel_mm || case_model.tiff_offset_hu != 0) && !volume::is_tiff_stack(*case_model.volume))
      throw BadInput(Reason::bad_value,
                     fmt::format("models: \"{}\": \"{}\" is for TIFF stacks only; {} states its own",
                                 case_model.name, case_model.voxel_mm ? "voxel_mm" : "tiff_offset_hu",
                                 case_model.volume->filename().string()));
    const volume::Volume volume = volume_at(*case_model.volume, case_model, case_model.tiff_offset_hu);
    std::optional<volume::Volume> mask = mask_on(volume, case_model, case_model.mask, "mask");
    std::optional<volume::Volume> tunnel_mask =
        mask_on(volume, case_model, case_model.tunnel_mask, "tunnel_mask");
    std::optional<registration::HuWindow> window;
    if (case_model.window_hu) window = {case_model.window_hu->x(), case_model.window_hu->y()};
    registration::Model model =
        value_or_throw(registration::model_from(case_model.name, volume, mask, window));
    model.warnings = volume.warnings;
    for (Warning& warning : value_or_throw(volume::check_hounsfield(
             volume,
             fmt::format("models: \"{}\": {}", case_model.name, case_model.volume->filename().string()))))
      model.warnings.push_back(std::move(warning));
    if (mask) model.warnings.insert(model.warnings.end(), mask->warnings.begin(), mask->warnings.end());
    if (tunnel_mask) {
      model.warnings.insert(model.warnings.end(), tunnel_mask->warnings.begin(), tunnel_mask->warnings.end());
      mask = std::move(tunnel_mask);
      window.reset();
    }
    if (has_tunnels && (mask || window)) compare(*registration::bone_surface(volume, mask, window), &volume);
    loaded.model = std::move(model);
    return loaded;
  });
}

}  // namespace helicarm::case_registration
