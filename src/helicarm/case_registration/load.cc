// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/load.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/geometry/import_matrix.h"
#include "helicarm/image/tiff.h"
#include "helicarm/pipeline/view_image.h"
#include "helicarm/rectification/rectify.h"
#include "helicarm/volume/read_volume.h"

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

volume::Volume tiff_stack(const fs::path& path, const Eigen::Vector3d& voxel_mm, double offset_hu) {
  const std::string bytes = value_or_throw(read_file(path, volume::max_volume_bytes));
  const std::string origin = path.filename().string();
  const int pages = value_or_throw(image::count_tiff_pages(bytes, origin));
  volume::Volume stack;
  for (int page = 0; page < pages; ++page) {
    const image::GreyImage slice = value_or_throw(image::decode_tiff(bytes, page, origin));
    const Eigen::Vector3i size(slice.pixels.width(), slice.pixels.height(), pages);
    if (page == 0)
      stack.voxels.reserve(value_or_throw(volume::voxel_count(size.cast<double>(), origin)));
    else if (size != stack.size)
      throw BadInput(Reason::bad_size,
                     fmt::format("{}: page {} has {} x {} pixels, the first {} x {}", origin, page + 1,
                                 size.x(), size.y(), stack.size.x(), stack.size.y()));
    stack.size = size;
    for (const std::uint16_t value : slice.pixels.pixels())
      stack.voxels.push_back(static_cast<float>(value + offset_hu));
  }
  stack.patient_from_voxel = Eigen::Scaling(voxel_mm);
  return stack;
}

bool is_stack(const fs::path& path) {
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  return extension == ".tif" || extension == ".tiff";
}

volume::Volume volume_at(const fs::path& path, const pipeline::CaseModel& given, double offset_hu) {
  if (!is_stack(path)) return value_or_throw(volume::read_volume(path));
  if (!given.voxel_mm)
    throw BadInput(Reason::bad_value,
                   fmt::format("models: \"{}\": \"voxel_mm\" is missing: a TIFF stack needs it", given.name));
  return tiff_stack(path, *given.voxel_mm, offset_hu);
}

bool has_voxels_of(const volume::Volume& volume, const Eigen::Vector3d& voxel_mm) {
  const Eigen::Vector3d spacing = volume.patient_from_voxel.linear().colwise().norm();
  return spacing.isApprox(voxel_mm, 1e-3);
}

void check_size(const std::string& view, const char* expected_by, const Eigen::Vector2i& expected,
                const image::Image<float>& image) {
  if (expected != Eigen::Vector2i(image.width(), image.height()))
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} {} x {} pixels, the image has {} x {}", view, expected_by,
                               expected.x(), expected.y(), image.width(), image.height()));
}

LoadedViews views_of_cameras(const pipeline::RegistrationCase& given) {
  LoadedViews loaded;
  for (std::size_t i = 0; i < given.base.views.size(); ++i) {
    const pipeline::CaseView& view = given.base.views[i];
    const xray::XrayImage image = value_or_throw(pipeline::image_of(view));
    const geometry::ImportedMatrix camera = value_or_throw(geometry::import_matrix(given.cameras[i]));
    if (camera.image_size) check_size(view.name, "the camera is for", *camera.image_size, image.pixels);
    loaded.views.push_back(view_of(image, view.name, camera.view));
    loaded.views.back().grey = image.pixels;
    loaded.maps.emplace_back();
    // The camera states what the pixels measure.
    std::ranges::copy_if(image.warnings, std::back_inserter(loaded.warnings),
                         [](const Warning& warning) { return warning.reason != Reason::spacing_missing; });
  }
  return loaded;
}

}  // namespace

LoadedViews views_of_calibration(const pipeline::RegistrationCase& given,
                                 const pipeline::CaseCalibration& calibration) {
  LoadedViews loaded;
  for (std::size_t i = 0; i < calibration.views.size(); ++i) {
    const pipeline::LabelledView& image = calibration.images[i];
    const calibration::CalibratedView& view = calibration.views[i];
    loaded.views.push_back(view_of(*image.xray_image, view.name, view.view));
    loaded.views.back().grey = rectification::resample(*image.xray_image, image.rectification.map);
    loaded.views.back().usable = usable_of(image, given.base.calibrator, view.view);
    loaded.maps.emplace_back(image.rectification.map);
  }
  loaded.camera_covariance = calibration.joint_covariance;
  loaded.warnings = calibration.warnings;
  return loaded;
}

Expected<LoadedViews> load_views(const pipeline::RegistrationCase& given, unsigned threads,
                                 const std::function<void(std::string_view stage)>& on_stage) {
  return guarded([&] {
    if (!given.cameras.empty()) {
      if (on_stage) on_stage("read");
      return views_of_cameras(given);
    }
    pipeline::RunOptions run;
    run.threads = threads;
    run.on_stage = on_stage;
    const double least_angle_deg = given.base.views.size() > 1 ? calibration::least_view_angle_deg : 0;
    const auto calibration = pipeline::calibrate_case(given.base, run, least_angle_deg);
    if (!calibration) throw BadInput(calibration.error().failure);
    return views_of_calibration(given, *calibration);
  });
}

Expected<std::vector<RegistrationView>> with_images(const LoadedViews& loaded,
                                                    const pipeline::RegistrationCase& given) {
  return guarded([&] {
    std::vector<RegistrationView> views = loaded.views;
    for (std::size_t i = 0; i < views.size(); ++i) {
      const pipeline::CaseView& asked = given.base.views[i];
      const auto image = value_or_throw(pipeline::image_of(asked));
      check_size(asked.name, "the sequence's first image has",
                 {views[i].grey.width(), views[i].grey.height()}, image.pixels);
      RegistrationView now = view_of(image, asked.name, views[i].view);
      now.grey = loaded.maps[i] ? rectification::resample(image, *loaded.maps[i]) : image.pixels;
      now.usable = std::move(views[i].usable);
      views[i] = std::move(now);
    }
    return views;
  });
}

Expected<std::optional<registration::Model>> load_model(const pipeline::CaseModel& given) {
  return guarded([&]() -> std::optional<registration::Model> {
    if (given.surface)
      return value_or_throw(
          registration::model_from(given.name, value_or_throw(registration::read_surface(*given.surface))));
    if (!given.volume) return std::nullopt;
    if (given.voxel_mm && !is_stack(*given.volume))
      throw BadInput(Reason::bad_value,
                     fmt::format("models: \"{}\": \"voxel_mm\" is for TIFF stacks only; {} states its own",
                                 given.name, given.volume->filename().string()));
    const volume::Volume volume = volume_at(*given.volume, given, given.tiff_offset_hu);
    std::optional<volume::Volume> mask;
    if (given.mask) mask = volume_at(*given.mask, given, 0);
    // A stack has no frame of its own: a mask drawn on it in another program brings that program's.
    if (mask && given.voxel_mm && has_voxels_of(*mask, *given.voxel_mm))
      mask->patient_from_voxel = volume.patient_from_voxel;
    std::optional<registration::HuWindow> window;
    if (given.window_hu) window = {given.window_hu->x(), given.window_hu->y()};
    return value_or_throw(registration::model_from(given.name, volume, mask, window));
  });
}

}  // namespace helicarm::case_registration
