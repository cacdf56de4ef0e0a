// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/same_views.h"

#include <algorithm>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::case_registration {

Expected<void> check_same_views(const Json& registration, const std::string& origin,
                                std::span<const measures::NamedView> views) {
  return guarded([&] {
    constexpr double most_apart_mm = 5, most_turned_deg = 1;
    JsonReader reader(registration, origin);
    for (JsonReader& row : reader.objects("views", false)) {
      const std::string name = row.text("name");
      const auto view = std::ranges::find(views, name, &measures::NamedView::name);
      if (view == views.end() || !row.has("camera_from_world")) continue;
      const Eigen::Matrix4d matrix =
          Eigen::Map<const Eigen::Matrix4d>(row.matrix("camera_from_world", 4, 4, {-1e6, 1e6}).data())
              .transpose();
      const geometry::RigidTransform registered =
          value_or_throw(geometry::rigid_transform_from(matrix, row.where() + ": camera_from_world"));
      const geometry::RigidTransform apart = registered * view->view.camera_from_world.inverse();
      const double turned_deg = Eigen::AngleAxisd(apart.rotation).angle() * 180 / EIGEN_PI;
      const double apart_mm =
          (registered.inverse().translation - view->view.camera_from_world.inverse().translation).norm();
      if (apart_mm > most_apart_mm || turned_deg > most_turned_deg)
        throw BadInput(
            Reason::bad_value,
            fmt::format("{}: view \"{}\": its camera is {:.1f} mm and {:.1f} degrees from that of the "
                        "calibration: they are of other images; register and calibrate the same",
                        origin, name, apart_mm, turned_deg));
    }
  });
}

}  // namespace helicarm::case_registration
