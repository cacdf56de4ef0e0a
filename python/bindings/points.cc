// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <map>

#include "arrays.h"
#include "checks.h"
#include "held_calibration.h"
#include "helicarm/core/parallel.h"
#include "helicarm/fiducials/find_target.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/localization/locate.h"
#include "helicarm/localization/pick_checks.h"
#include "helicarm/localization/tre_volume.h"
#include "module.h"

namespace helicarm::python {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

const rectification::DistortionMap& map_of(const HeldCalibration& calibration, std::size_t view) {
  if (const auto& map = calibration.maps[view]) return *map;
  raise({Reason::usage,
         "raw=True requires a distortion map, this view has none: give rectified pixels, or calibrate from "
         "ViewPoints with map",
         calibration.views[view].name,
         {}});
}

py::array projected(const HeldCalibration& calibration, const Doubles& xyz_mm, const ViewKey& key, bool raw) {
  const std::size_t view = calibration.index_of(key);
  const geometry::View& camera = calibration.views[view].view;
  std::vector<Eigen::Vector2d> pixels;
  for (const Eigen::Vector3d& point : rows_of<3>(xyz_mm, "xyz_mm")) {
    Eigen::Vector2d uv = Eigen::Vector2d::Constant(nan);
    if (camera.depth(point) > 0) uv = camera.project(point);
    if (raw && uv.allFinite())
      uv =
          rectification::raw_in_image(map_of(calibration, view), uv).value_or(Eigen::Vector2d::Constant(nan));
    pixels.push_back(uv);
  }
  if (raw) map_of(calibration, view);
  return rows_array<2>(pixels, xyz_mm.ndim() == 1);
}

/// The observations of one call: views as indices, each once.
std::map<std::size_t, Doubles> by_view(const HeldCalibration& calibration,
                                       const std::map<ViewKey, Doubles>& observations) {
  std::map<std::size_t, Doubles> views;
  for (const auto& [key, uv] : observations) {
    const std::size_t view = calibration.index_of(key);
    if (!views.emplace(view, uv).second)
      raise({Reason::name_clash,
             "observations: the view is given twice, by its name and its index",
             calibration.views[view].name,
             {}});
  }
  return views;
}

Expected<localization::PointObservation> observation_of(const HeldCalibration& calibration, std::size_t view,
                                                        const Eigen::Vector2d& uv,
                                                        std::optional<double> sigma_px, bool raw) {
  if (const auto& map = calibration.maps[view]; !raw && map && !rectification::raw_in_image(*map, uv))
    return tl::unexpected<Failure>(
        Failure{Reason::not_seen,
                fmt::format("{:g}, {:g} lies outside the rectified image", uv.x(), uv.y()),
                calibration.views[view].name,
                {}});
  auto seen = raw ? fiducials::point_of_click(map_of(calibration, view), uv, sigma_px)
                  : Expected<fiducials::ImagePoint>({uv, uv, sigma_px.value_or(fiducials::click_sigma_px)});
  if (!seen) {
    Failure failure = std::move(seen).error();
    failure.view = calibration.views[view].name;
    return tl::unexpected<Failure>(std::move(failure));
  }
  return localization::PointObservation{view, seen->uv,
                                        seen->sigma_px * seen->sigma_px * Eigen::Matrix2d::Identity()};
}

/// helicarm.LocatedPoint.
struct HeldPoint : localization::LocatedPoint {
  std::optional<Warning> note;  ///< pixels_taken_as_rectified
};

HeldPoint located(const HeldCalibration& calibration, const std::map<ViewKey, Doubles>& observations,
                  std::optional<double> sigma_px, bool raw, const std::string& name) {
  checked(sigma_px, not_negative, "sigma_px");
  std::vector<localization::PointObservation> observed;
  for (const auto& [view, uv] : by_view(calibration, observations))
    observed.push_back(value_or_raise(observation_of(
        calibration, view, row_of<2>(uv, "observations", calibration.views[view].name), sigma_px, raw)));
  return {value_or_raise(localization::locate(name, localization::PointSource::pick, observed, calibration)),
          raw ? std::nullopt : localization::pixels_taken_as_rectified(observed, calibration)};
}

using Located = Expected<localization::LocatedPoint>;

/// Row i of every view's array; a view whose row is NaN does not show the point.
std::vector<Located> located_rows(const HeldCalibration& calibration,
                                  const std::map<std::size_t, std::vector<Eigen::Vector2d>>& rows,
                                  std::size_t count, std::optional<double> sigma_px, bool raw,
                                  unsigned threads) {
  std::vector<Located> points(count, fail(Reason::not_seen, ""));
  parallel_for(count, threads, [&](std::size_t i) {
    std::vector<localization::PointObservation> observed;
    for (const auto& [view, of_view] : rows) {
      if (of_view[i].array().isNaN().any()) continue;
      const auto one = observation_of(calibration, view, of_view[i], sigma_px, raw);
      if (!one) {
        points[i] = tl::unexpected<Failure>(one.error());
        return;
      }
      observed.push_back(*one);
    }
    points[i] = localization::locate("", localization::PointSource::pick, observed, calibration);
  });
  localization::inflate_if_views_contradict(points);
  return points;
}

py::dict arrays_of(const std::vector<Located>& points) {
  const auto n = py::ssize_t(points.size());
  std::vector<Eigen::Vector3d> places;
  py::array_t<double> covariances({n, py::ssize_t{3}, py::ssize_t{3}}), error(n), gap(n), chi2(n);
  py::list reasons, warnings;
  for (py::ssize_t i = 0; i < n; ++i) {
    const Located& point = points[std::size_t(i)];
    const Eigen::Matrix3d covariance =
        point ? point->covariance_in_anchor : Eigen::Matrix3d(Eigen::Matrix3d::Constant(nan));
    places.push_back(point ? point->point_in_anchor : Eigen::Vector3d(Eigen::Vector3d::Constant(nan)));
    Eigen::Map<Eigen::Matrix3d>(covariances.mutable_data(i)) = covariance;
    error.mutable_at(i) = point ? localization::length_at_95(covariance) : nan;
    gap.mutable_at(i) = point ? point->ray_gap_mm : nan;
    chi2.mutable_at(i) = point ? point->chi2 : nan;
    reasons.append(point ? py::object(py::none()) : py::object(warning_dict(point.error())));
    warnings.append(point && point->missing_rays ? py::object(warning_dict(*point->missing_rays))
                                                 : py::object(py::none()));
  }
  py::dict arrays;
  arrays["xyz_mm"] = rows_array<3>(places);
  arrays["covariance_mm2"] = covariances;
  arrays["error_95_mm"] = error;
  arrays["ray_gap_mm"] = gap;
  arrays["chi2"] = chi2;
  arrays["reasons"] = reasons;
  arrays["warnings"] = warnings;
  return arrays;
}

py::dict located_all(const HeldCalibration& calibration, const std::map<ViewKey, Doubles>& observations,
                     std::optional<double> sigma_px, bool raw, unsigned threads) {
  checked(sigma_px, not_negative, "sigma_px");
  std::map<std::size_t, std::vector<Eigen::Vector2d>> rows;
  for (const auto& [view, uv] : by_view(calibration, observations)) {
    const std::string& name = calibration.views[view].name;
    if (raw) map_of(calibration, view);
    rows[view] = rows_of<2>(uv, "observations", name, false);
    if (rows[view].size() != rows.begin()->second.size())
      raise({Reason::bad_value,
             fmt::format("observations: {} points, another view has {}", rows[view].size(),
                         rows.begin()->second.size()),
             name,
             {}});
  }
  if (rows.empty()) raise({Reason::bad_value, "observations: is empty", {}, {}});
  const std::size_t count = rows.begin()->second.size();
  auto arrays =
      arrays_of(without_gil([&] { return located_rows(calibration, rows, count, sigma_px, raw, threads); }));
  std::vector<localization::PointObservation> picks;
  for (const auto& [view, of_view] : rows)
    for (const Eigen::Vector2d& uv : of_view)
      if (!raw && uv.allFinite()) picks.push_back({view, uv, Eigen::Matrix2d::Zero()});
  py::list notes;
  if (const auto note = localization::pixels_taken_as_rectified(picks, calibration))
    notes.append(warning_dict(*note));
  arrays["notes"] = notes;
  return arrays;
}

py::array predicted(const HeldCalibration& calibration, const Doubles& xyz_mm, double sigma_px) {
  checked(sigma_px, not_negative, "sigma_px");
  const auto points = rows_of<3>(xyz_mm, "xyz_mm");
  if (xyz_mm.ndim() == 1)
    return matrix_array(value_or_raise(localization::predict_covariance(points[0], sigma_px, calibration)));
  py::array_t<double> covariances({py::ssize_t(points.size()), py::ssize_t{3}, py::ssize_t{3}});
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto one = localization::predict_covariance(points[i], sigma_px, calibration);
    const Eigen::Matrix3d covariance = one ? *one : Eigen::Matrix3d(Eigen::Matrix3d::Constant(nan));
    Eigen::Map<Eigen::Matrix3d>(covariances.mutable_data(py::ssize_t(i))) = covariance;
  }
  return covariances;
}

py::dict tre_map(const HeldCalibration& calibration, const Doubles& centre_mm, double half_mm, double step_mm,
                 double sigma_px, unsigned threads) {
  constexpr double most_steps = 100;
  const Eigen::Vector3d centre = row_of<3>(centre_mm, "centre_mm");
  checked(half_mm, positive, "half_mm");
  checked(step_mm, {half_mm / most_steps}, "step_mm");
  checked(sigma_px, not_negative, "sigma_px");
  auto* volume = new localization::TreVolume(without_gil(
      [&] { return localization::predict_tre(calibration, centre, half_mm, step_mm, sigma_px, threads); }));
  const py::capsule owner(volume, [](void* memory) { delete static_cast<localization::TreVolume*>(memory); });
  const py::ssize_t side = volume->side, size = sizeof(double);
  py::dict map;
  map["first_mm"] = rows_array<3>({volume->first}, true);
  map["step_mm"] = volume->step_mm;
  map["rms_mm"] = py::array_t<double>({side, side, side}, {size, side * size, side * side * size},
                                      volume->rms_mm.data(), owner);
  return map;
}

}  // namespace

void add_points(py::module_& module) {
  py::class_<HeldPoint>(module, "LocatedPoint", "A point in space with its confidence region.")
      .def_readonly("name", &HeldPoint::name)
      .def_property_readonly(
          "xyz_mm", [](const HeldPoint& p) { return read_only(rows_array<3>({p.point_in_anchor}, true)); },
          "(3,) calibrator frame, mm.")
      .def_property_readonly(
          "covariance_mm2",
          [](const HeldPoint& p) { return read_only(matrix_array(p.covariance_in_anchor)); },
          "(3, 3) mm^2, axes of the calibrator frame.")
      .def_property_readonly(
          "error_95_mm",
          [](const HeldPoint& p) { return localization::length_at_95(p.covariance_in_anchor); },
          "Distance from the true point that 95 % of such points do not exceed, mm.")
      .def_property_readonly("predicted_rms_mm", &HeldPoint::predicted_rms_mm,
                             "Root of the covariance's trace, mm.")
      .def_readonly("ray_gap_mm", &HeldPoint::ray_gap_mm, "Largest distance between two of the rays, mm.")
      .def_readonly("chi2", &HeldPoint::chi2, "2n - 3 degrees of freedom with n views.")
      .def_readonly("views", &HeldPoint::views)
      .def_property_readonly(
          "warning",
          [](const HeldPoint& p) {
            return p.missing_rays ? py::object(warning_dict(*p.missing_rays)) : py::object(py::none());
          },
          "residual_too_large where the rays miss each other and the covariance was enlarged; else None.")
      .def_property_readonly(
          "note",
          [](const HeldPoint& p) {
            return p.note ? py::object(warning_dict(*p.note)) : py::object(py::none());
          },
          "pixels_taken_as_rectified: how far raw pixels are from the given ones, where the views have a map "
          "and "
          "raw was not set; else None.")
      .def("__repr__", [](const HeldPoint& p) {
        return fmt::format("<LocatedPoint {}: {:.3f} {:.3f} {:.3f} mm, within {:.3f} mm (95 %){}>", p.name,
                           p.point_in_anchor.x(), p.point_in_anchor.y(), p.point_in_anchor.z(),
                           localization::length_at_95(p.covariance_in_anchor),
                           p.missing_rays ? fmt::format(", warning {}", code(p.missing_rays->reason)) : "");
      });
}

void add_point_methods(py::class_<HeldCalibration>& held) {
  held.def(
          "project", &projected, py::arg("xyz_mm"), py::arg("view"), py::kw_only(), py::arg("raw") = false,
          R"((N, 3) or (3,) calibrator mm to (N, 2) or (2,) pixels; NaN behind the source or (raw) off the image.

Raises InputError: usage for raw=True where the view has no distortion map.)")
      .def("locate", &located, py::arg("observations"), py::kw_only(), py::arg("sigma_px") = py::none(),
           py::arg("raw") = false, py::arg("name") = "point",
           R"(A point seen in two views or more (Eq. 8 by least squares); of many points see locate_all.

observations: {view: (u, v)}, rectified pixels, or raw ones with raw=True, to which the map's error is added.
sigma_px: per axis, 0: exact; not given: 0.5, of a click by hand. Returns a LocatedPoint. Raises InputError: bad_value,
not_finite, name_clash, usage (raw=True where the view has no distortion map); RefusedError: not_seen (fewer than two
views, or raw pixels off the image), parallel_rays, point_at_infinity, behind_source.)")
      .def("locate_all", &located_all, py::arg("observations"), py::kw_only(),
           py::arg("sigma_px") = py::none(), py::arg("raw") = false, py::arg("threads") = 0,
           R"(N points at once: observations: {view: (N, 2)}; a row of NaN: the view does not show this point.

Other arguments as locate's. Returns {"xyz_mm": (N, 3), "covariance_mm2": (N, 3, 3), "error_95_mm", "ray_gap_mm",
"chi2": (N,), all NaN where a point was not located, "reasons", "warnings": lists of N, None or {code, message, view,
figures}, "notes": [pixels_taken_as_rectified] or []}. Where the rays of most points miss, all have the warning. Releases the GIL. Raises InputError as locate; a refusal of one point is its entry of "reasons".)")
      .def("predict", &predicted, py::arg("xyz_mm"), py::kw_only(), py::arg("sigma_px"),
           R"(Covariance (mm^2) of points before they are picked, with this noise per axis in all views.

(3,) gives (3, 3); (N, 3) gives (N, 3, 3) with NaN where no point can be located. Raises InputError: bad_value,
not_finite; RefusedError: behind_source.)")
      .def("tre_map", &tre_map, py::arg("centre_mm"), py::kw_only(), py::arg("half_mm"), py::arg("step_mm"),
           py::arg("sigma_px"), py::arg("threads") = 0,
           R"(Predicted TRE on a cubic lattice within half_mm of centre_mm; step_mm is at least half_mm / 100.

Returns {"first_mm": (3,), "step_mm", "rms_mm": (n, n, n) indexed [x, y, z], not copied, NaN where no point can be
located}. Releases the GIL. Raises InputError: bad_value, not_finite.)");
}

}  // namespace helicarm::python
