// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/view_messages.h"

#include <cmath>

#include <fmt/format.h>

#include "helicarm/devices/tracker/igtl_image.h"
#include "helicarm/rectification/rectified_dicom.h"

namespace helicarm::operation {
namespace {

constexpr std::size_t longest_device_name = 20;
constexpr std::string_view camera_ending = "_camera";

/// The image's plane: the detector's, where its pixel size is known, else as the Slicer module chooses.
double plane_of(const geometry::View& view, const rectification::DistortionMap& map) {
  const bool is_known =
      map.rectified_pixel_mm && map.rectified_plane == rectification::RectifiedPlane::detector;
  if (is_known) return std::abs(view.intrinsics.fy) * *map.rectified_pixel_mm;
  const double origin_mm = view.depth(Eigen::Vector3d::Zero());
  return origin_mm > 0 ? 2 * origin_mm : usual_plane_mm;
}

/// LPS to RAS.
Eigen::Vector3d as_ras(const Eigen::Vector3d& lps) { return {-lps.x(), -lps.y(), lps.z()}; }

tracker::IgtlMessage image_of(const std::string& name, const pipeline::ViewResult& view) {
  const xray::DerivedImage image =
      rectification::rectified_dicom(*view.xray_image, view.rectification->map, "rectified");
  const geometry::Intrinsics& k = view.calibrated->view.intrinsics;
  const geometry::RigidTransform world_from_camera = view.calibrated->view.camera_from_world.inverse();
  const double plane_mm = plane_of(view.calibrated->view, view.rectification->map);
  const auto placed = [&](double u, double v) -> Eigen::Vector3d {
    const double y = (v - k.v0) / k.fy, x = (u - k.u0 - k.skew * y) / k.fx;
    return as_ras(world_from_camera * (plane_mm * Eigen::Vector3d(x, y, 1)));
  };
  const int width = image.pixels.width(), height = image.pixels.height();
  const Eigen::Vector3d first = placed(0, 0);
  return tracker::image_message(name, {image.pixels.pixels(), width, height, placed(1, 0) - first,
                                       placed(0, 1) - first, placed(0.5 * (width - 1), 0.5 * (height - 1))});
}

tracker::IgtlMessage camera_of(const std::string& name, const geometry::View& view) {
  const auto signs = Eigen::Vector4d(-1, -1, 1, 1).asDiagonal();
  const Eigen::Matrix4d world_from_camera = view.camera_from_world.inverse().matrix();
  return {name + std::string(camera_ending), 0, tracker::IgtlTransform{signs * world_from_camera * signs}};
}

}  // namespace

Expected<std::vector<tracker::IgtlMessage>> messages_of_views(const pipeline::Result& result) {
  return guarded([&] {
    if (result.failure) throw BadInput(*result.failure);
    std::vector<tracker::IgtlMessage> messages;
    for (std::size_t i = 0; i < result.views.size(); ++i) {
      const pipeline::ViewResult& view = result.views[i];
      if (!view.calibrated || !view.xray_image || !view.rectification) continue;
      const bool fits = view.name.size() + camera_ending.size() <= longest_device_name;
      const std::string name = fits ? view.name : fmt::format("V{}", i + 1);
      messages.push_back(image_of(name, view));
      messages.push_back(camera_of(name, view.calibrated->view));
    }
    return messages;
  });
}

}  // namespace helicarm::operation
