// SPDX-License-Identifier: Apache-2.0
#include <limits>
#include <map>
#include <variant>

#include "arrays.h"
#include "held_calibration.h"
#include "helicarm/calibration/calibrate.h"
#include "helicarm/calibration/saved_calibration.h"
#include "helicarm/fiducials/find_target.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/localization/locate.h"
#include "helicarm/localization/tre_volume.h"
#include "module.h"

namespace helicarm::python {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
using ViewKey = std::variant<std::size_t, std::string>;

std::size_t index_of(const HeldCalibration& calibration, const ViewKey& key) {
  for (std::size_t i = 0; i < calibration.views.size(); ++i)
    if (key == ViewKey(i) || key == ViewKey(calibration.views[i].name)) return i;
  const std::string text = std::holds_alternative<std::string>(key)
                               ? '"' + std::get<std::string>(key) + '"'
                               : std::to_string(std::get<std::size_t>(key));
  raise({Reason::bad_value, fmt::format("view: the calibration has no view {}", text), {}, {}});
}

const calibration::CalibratedView& view_of(const HeldCalibration& calibration, const ViewKey& key) {
  return calibration.views[index_of(calibration, key)];
}

/// The points of one view as calibrate takes them.
calibration::ViewFiducials view_points(const std::string& name, const Doubles& xyz_mm, const Doubles& uv,
                                       const Doubles& sigma_px,
                                       const std::optional<std::vector<std::string>>& labels,
                                       const geometry::IntrinsicsPrior& prior,
                                       const std::optional<Doubles>& map_covariance_px2) {
  const auto points = rows_of<3>(xyz_mm, "xyz_mm");
  const auto pixels = rows_of<2>(uv, "uv");
  const std::size_t n = points.size();
  if (pixels.size() != n || (labels && labels->size() != n) ||
      (sigma_px.ndim() != 0 && std::size_t(sigma_px.size()) != n))
    raise({Reason::bad_value,
           fmt::format("view {}: xyz_mm, uv, sigma_px and labels differ in length", name),
           {},
           {}});
  calibration::ViewFiducials view{name, {}, prior, {}, {}};
  for (std::size_t i = 0; i < n; ++i) {
    fiducials::Fiducial fiducial{labels ? (*labels)[i] : fmt::format("P{}", i + 1), points[i],
                                 fiducials::FiducialStatus::used, pixels[i], pixels[i]};
    fiducial.sigma_px = sigma_px.data()[sigma_px.ndim() == 0 ? 0 : i];
    view.fiducials.push_back(fiducial);
  }
  if (map_covariance_px2)
    view.map_covariance_px2 =
        matrix_of(*map_covariance_px2, py::ssize_t(n), py::ssize_t(n), "map_covariance_px2");
  return view;
}

/// Of N balls: (N, 3, 3), each ball's own, or (3 N, 3 N), of all together.
void set_ball_covariance(const Doubles& mm2, py::ssize_t balls, calibration::CommonPrior& common) {
  constexpr const char* name = "ball_covariance_mm2";
  if (mm2.ndim() == 2) {
    common.joint_ball_covariance_mm2 = matrix_of(mm2, 3 * balls, 3 * balls, name);
    return;
  }
  if (mm2.ndim() != 3 || mm2.shape(0) != balls || mm2.shape(1) != 3 || mm2.shape(2) != 3)
    raise({Reason::bad_value,
           fmt::format("{}: shape {} is neither ({}, 3, 3) nor ({}, {})", name, shape_of(mm2), balls,
                       3 * balls, 3 * balls),
           {},
           {}});
  check_finite(mm2, name);
  for (py::ssize_t ball = 0; ball < balls; ++ball)
    common.ball_covariance_mm2.emplace_back(
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(mm2.data(ball, 0, 0)));
}

HeldCalibration calibrated(const std::vector<calibration::ViewFiducials>& views,
                           const calibration::CArmPrior& c_arm,
                           const std::optional<Doubles>& ball_covariance_mm2, double scale_sigma,
                           double rejection_probability, double largest_rms_px) {
  calibration::CalibrationOptions options{
      {c_arm, {}, {}, scale_sigma}, rejection_probability, largest_rms_px};
  if (ball_covariance_mm2)
    for (const calibration::ViewFiducials& view : views) {
      options.common.ball_covariance_mm2.clear();
      set_ball_covariance(*ball_covariance_mm2, py::ssize_t(view.fiducials.size()), options.common);
    }
  calibration::CalibrationResult result =
      value_or_raise(without_gil([&] { return calibration::calibrate(views, options); }));
  HeldCalibration held{static_cast<const calibration::Calibration&>(result),
                       {},
                       result.fiducials,
                       result.chi2,
                       result.dof,
                       result.variance_scale,
                       result.warnings};
  held.maps.resize(held.views.size());
  return held;
}

HeldCalibration loaded(const std::filesystem::path& path) {
  calibration::SavedCalibration saved = value_or_raise(
      calibration::saved_calibration_from_json(value_or_raise(read_json(path)), path.filename().string()));
  return {static_cast<const calibration::Calibration&>(saved), std::move(saved.maps), {}, {}, {}, {}, {}};
}

py::array projected(const HeldCalibration& calibration, const Doubles& xyz_mm, const ViewKey& key, bool raw) {
  const std::size_t which = index_of(calibration, key);
  const geometry::View& view = calibration.views[which].view;
  const auto& map = calibration.maps[which];
  std::vector<Eigen::Vector2d> pixels;
  for (const Eigen::Vector3d& point : rows_of<3>(xyz_mm, "xyz_mm")) {
    std::optional<Eigen::Vector2d> uv;
    if (view.depth(point) > 0) uv = view.project(point);
    if (uv && raw && map) uv = rectification::raw_in_image(*map, *uv);
    pixels.push_back(uv.value_or(Eigen::Vector2d::Constant(nan)));
  }
  return rows_array<2>(pixels, xyz_mm.ndim() == 1);
}

localization::PointObservation observation_from(const HeldCalibration& calibration, const ViewKey& key,
                                                const Doubles& uv, std::optional<double> sigma_px, bool raw) {
  const auto pixels = rows_of<2>(uv, "observations");
  if (pixels.size() != 1)
    raise({Reason::bad_value, "observations: must hold one (u, v) for each view", {}, {}});
  if (sigma_px && !(*sigma_px >= 0)) raise({Reason::bad_value, "sigma_px: is negative", {}, {}});
  const std::size_t view = index_of(calibration, key);
  const auto& map = calibration.maps[view];
  const fiducials::ImagePoint seen =
      raw && map ? value_or_raise(fiducials::point_of_click(*map, pixels[0], sigma_px))
                 : fiducials::ImagePoint{pixels[0], pixels[0], sigma_px.value_or(fiducials::click_sigma_px)};
  return {view, seen.uv, seen.sigma_px * seen.sigma_px * Eigen::Matrix2d::Identity()};
}

localization::LocatedPoint located(const HeldCalibration& calibration,
                                   const std::map<ViewKey, Doubles>& observations,
                                   std::optional<double> sigma_px, bool raw, const std::string& name) {
  std::vector<localization::PointObservation> observed;
  for (const auto& [key, uv] : observations)
    observed.push_back(observation_from(calibration, key, uv, sigma_px, raw));
  return value_or_raise(localization::locate(name, localization::PointSource::pick, observed, calibration));
}

py::array predicted(const HeldCalibration& calibration, const Doubles& xyz_mm, double sigma_px) {
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
  const auto centre = rows_of<3>(centre_mm, "centre_mm");
  if (centre.size() != 1 || !(half_mm > 0) || !(step_mm > 0) || half_mm / step_mm > 100)
    raise({Reason::bad_value, "tre_map: one centre, half_mm > 0, step_mm at least half_mm / 100", {}, {}});
  auto* volume = new localization::TreVolume(without_gil([&] {
    return localization::predict_tre(calibration, centre[0], half_mm, step_mm, sigma_px, threads);
  }));
  const py::capsule owner(volume, [](void* memory) { delete static_cast<localization::TreVolume*>(memory); });
  const py::ssize_t side = volume->side, size = sizeof(double);
  py::dict map;
  map["first_mm"] = rows_array<3>({volume->first}, true);
  map["step_mm"] = volume->step_mm;
  map["rms_mm"] = py::array_t<double>({side, side, side}, {size, side * size, side * side * size},
                                      volume->rms_mm.data(), owner);
  return map;
}

py::list fiducials(const HeldCalibration& calibration, const ViewKey& key) {
  static constexpr std::array<const char*, 5> words{"used", "occluded", "outside", "rejected", "not_found"};
  py::list list;
  const std::size_t view = index_of(calibration, key);
  if (calibration.fiducials.empty()) return list;
  for (const fiducials::Fiducial& fiducial : calibration.fiducials[view]) {
    const bool seen = fiducial.status == fiducials::FiducialStatus::used ||
                      fiducial.status == fiducials::FiducialStatus::rejected;
    const auto pixel = [&](const Eigen::Vector2d& uv) {
      return seen ? py::object(rows_array<2>({uv}, true)) : py::object(py::none());
    };
    py::dict one;
    one["label"] = fiducial.label;
    one["status"] = words[std::size_t(fiducial.status)];
    one["xyz_mm"] = rows_array<3>({fiducial.centre_in_calibrator}, true);
    one["uv_raw"] = pixel(fiducial.uv_raw);
    one["uv"] = pixel(fiducial.uv);
    one["sigma_px"] = seen ? py::object(py::float_(fiducial.sigma_px)) : py::none();
    one["residual_px"] = seen ? py::object(py::float_(fiducial.residual_px)) : py::none();
    list.append(one);
  }
  return list;
}

void add_priors(py::module_& module) {
  const geometry::IntrinsicsPrior usual;
  const auto pair_of =
      [](const std::optional<geometry::NormalPrior>& b) -> std::optional<std::pair<double, double>> {
    if (!b) return std::nullopt;
    return std::pair(b->value, b->sigma);
  };
  py::class_<geometry::IntrinsicsPrior>(
      module, "IntrinsicsPrior",
      R"(What is known of one view's intrinsics beforehand, rectified pixels.

focal_px: nominal mean of |fx| and fy; principal_px: (u, v); unit_px: the unit of CArmPrior in this view, px per mm on
the receiver, or 1; aspect: (value, sigma) of |fx| / fy; skew: (value, sigma) over fy, None: free.)")
      .def(py::init([](std::optional<double> focal_px, const std::optional<Doubles>& principal_px,
                       double unit_px, const std::optional<std::pair<double, double>>& aspect,
                       const std::optional<std::pair<double, double>>& skew) {
             geometry::IntrinsicsPrior prior;
             prior.focal_px = focal_px;
             if (principal_px) prior.principal_px = rows_of<2>(*principal_px, "principal_px").at(0);
             prior.unit_px = unit_px;
             prior.aspect.reset();
             prior.skew.reset();
             if (aspect) prior.aspect = geometry::NormalPrior{aspect->first, aspect->second};
             if (skew) prior.skew = geometry::NormalPrior{skew->first, skew->second};
             return prior;
           }),
           py::kw_only(), py::arg("focal_px") = usual.focal_px, py::arg("principal_px") = py::none(),
           py::arg("unit_px") = usual.unit_px, py::arg("aspect") = pair_of(usual.aspect),
           py::arg("skew") = pair_of(usual.skew));
  py::class_<calibration::CArmPrior>(module, "CArmPrior",
                                     R"(How far a C-arm's intrinsics may be from nominal: standard deviations.

focal, principal: (common to all views, of each view: sag), in units of IntrinsicsPrior.unit_px; None: not known.)")
      .def(py::init([](const std::optional<std::pair<double, double>>& focal,
                       const std::optional<std::pair<double, double>>& principal) {
             calibration::CArmPrior prior;
             if (focal) prior.focal = calibration::IntrinsicsVariation{focal->first, focal->second};
             if (principal)
               prior.principal = calibration::IntrinsicsVariation{principal->first, principal->second};
             return prior;
           }),
           py::kw_only(), py::arg("focal") = py::none(), py::arg("principal") = py::none());
  py::class_<calibration::ViewFiducials>(module, "ViewPoints",
                                         R"(Labelled image points of one view, for calibrate.

ViewPoints(name, xyz_mm, uv, *, sigma_px, labels=None, prior=IntrinsicsPrior(), map_covariance_px2=None)
  xyz_mm: (N, 3) world, mm; uv: (N, 2) pixels free of distortion; sigma_px: per axis, one number or (N,)
  map_covariance_px2: (N, N) covariance per axis that the points share, already in sigma_px
Raises InputError: bad_value, not_finite.)")
      .def(py::init(&view_points), py::arg("name"), py::arg("xyz_mm"), py::arg("uv"), py::kw_only(),
           py::arg("sigma_px"), py::arg("labels") = py::none(), py::arg("prior") = usual,
           py::arg("map_covariance_px2") = py::none())
      .def_readonly("name", &calibration::ViewFiducials::name)
      .def("__len__", [](const calibration::ViewFiducials& view) { return view.fiducials.size(); });
}

void add_points(py::module_& module) {
  py::class_<localization::LocatedPoint>(module, "LocatedPoint",
                                         "A point in space with its confidence region.")
      .def_readonly("name", &localization::LocatedPoint::name)
      .def_property_readonly(
          "xyz_mm",
          [](const localization::LocatedPoint& p) { return rows_array<3>({p.point_in_anchor}, true); },
          "(3,) calibrator frame, mm.")
      .def_property_readonly(
          "covariance_mm2",
          [](const localization::LocatedPoint& p) { return matrix_array(p.covariance_in_anchor); },
          "(3, 3) mm^2.")
      .def_property_readonly(
          "error_95_mm",
          [](const localization::LocatedPoint& p) {
            return localization::length_at_95(p.covariance_in_anchor);
          },
          "Length that 95 % of the errors with this covariance do not exceed, mm.")
      .def_property_readonly("predicted_rms_mm", &localization::LocatedPoint::predicted_rms_mm,
                             "Root of the covariance's trace, mm.")
      .def_readonly("ray_gap_mm", &localization::LocatedPoint::ray_gap_mm,
                    "Largest distance between two of the rays, mm.")
      .def_readonly("chi2", &localization::LocatedPoint::chi2, "2n - 3 degrees of freedom with n views.")
      .def_readonly("views", &localization::LocatedPoint::views)
      .def_property_readonly(
          "warning",
          [](const localization::LocatedPoint& p) {
            return p.missing_rays ? py::object(warning_dict(*p.missing_rays)) : py::object(py::none());
          },
          "residual_too_large where the rays miss each other and the covariance was enlarged; else None.")
      .def("__repr__", [](const localization::LocatedPoint& p) {
        return fmt::format("<LocatedPoint {}: {:.3f} {:.3f} {:.3f} mm, within {:.3f} mm (95 %)>", p.name,
                           p.point_in_anchor.x(), p.point_in_anchor.y(), p.point_in_anchor.z(),
                           localization::length_at_95(p.covariance_in_anchor));
      });
}

using Held = HeldCalibration;

void add_parameters(py::class_<Held>& held) {
  held.def(
          "projection",
          [](const Held& c, const ViewKey& v) { return matrix_array(view_of(c, v).view.projection()); },
          py::arg("view"),
          "(3, 4) calibrator (mm) to homogeneous pixels; the third row's first part has unit norm.")
      .def(
          "intrinsics",
          [](const Held& c, const ViewKey& v) {
            return matrix_array(view_of(c, v).view.intrinsics.matrix());
          },
          py::arg("view"), "(3, 3) K, pixels; fx < 0 in a mirrored image.")
      .def(
          "camera_from_calibrator",
          [](const Held& c, const ViewKey& v) {
            return matrix_array(view_of(c, v).view.camera_from_world.matrix());
          },
          py::arg("view"), "(4, 4) mm; camera: origin at the X-ray source, z towards the detector.")
      .def(
          "covariance",
          [](const Held& c, const ViewKey& v) { return matrix_array(view_of(c, v).covariance); },
          py::arg("view"),
          "(11, 11) of fx, fy, u0, v0 (px), rotation vector in the camera frame (rad), translation (mm), "
          "skew.")
      .def_property_readonly(
          "joint_covariance", [](const Held& c) { return matrix_array(c.joint_covariance); },
          "(11 n, 11 n) of all n views' parameters; (0, 0): not computed.")
      .def(
          "map", [](const Held& c, const ViewKey& v) { return c.maps[index_of(c, v)]; }, py::arg("view"),
          "The view's DistortionMap, or None where the pixels were given free of distortion.")
      .def("fiducials", &fiducials, py::arg("view"),
           "List of {label, status, xyz_mm, uv_raw, uv, sigma_px, residual_px}; empty where not known.")
      .def_readonly("chi2", &Held::chi2)
      .def_readonly("dof", &Held::dof)
      .def_readonly("variance_scale", &Held::variance_scale,
                    "Factor of the covariance where the residuals exceed the sigmas.")
      .def_property_readonly("warnings", [](const Held& c) { return warning_list(c.warnings); });
}

}  // namespace

void add_calibration(py::module_& module) {
  add_priors(module);
  add_points(module);
  py::class_<Held> held(module, "Calibration", R"(Views calibrated together; all that points are located by.

World: calibrator frame, mm. Pixels: rectified unless raw=True. A view is given by its name or index.)");
  held.def_static("load", &loaded, py::arg("path"),
                  "From result.json of a run that was not refused. Raises InputError.")
      .def_property_readonly("names",
                             [](const Held& c) {
                               std::vector<std::string> names;
                               for (const auto& view : c.views) names.push_back(view.name);
                               return names;
                             })
      .def("__len__", [](const Held& c) { return c.views.size(); })
      .def("project", &projected, py::arg("xyz_mm"), py::arg("view"), py::kw_only(), py::arg("raw") = false,
           "(N, 3) or (3,) calibrator mm to (N, 2) or (2,) pixels; NaN behind the source or (raw) off the "
           "image.")
      .def("locate", &located, py::arg("observations"), py::kw_only(), py::arg("sigma_px") = py::none(),
           py::arg("raw") = false, py::arg("name") = "point",
           R"(A point seen in two views or more (Eq. 8 by least squares).

observations: {view: (u, v)}, rectified pixels, or raw ones with raw=True. sigma_px: per axis, 0: exact; not given: of
a click. Returns a LocatedPoint. Raises RefusedError: not_seen, parallel_rays, point_at_infinity, behind_source.)")
      .def("predict", &predicted, py::arg("xyz_mm"), py::kw_only(), py::arg("sigma_px"),
           R"(Covariance (mm^2) of points before they are picked, with this noise per axis in all views.

(3,) gives (3, 3); (N, 3) gives (N, 3, 3) with NaN where no point can be located. Raises RefusedError: behind_source.)")
      .def("tre_map", &tre_map, py::arg("centre_mm"), py::kw_only(), py::arg("half_mm"), py::arg("step_mm"),
           py::arg("sigma_px"), py::arg("threads") = 0,
           R"(Predicted TRE on a cubic lattice within half_mm of centre_mm.

Returns {"first_mm": (3,), "step_mm", "rms_mm": (n, n, n) indexed [x, y, z], not copied, NaN where no point can be
located}. Releases the GIL. Raises InputError: bad_value.)");
  add_parameters(held);
  const calibration::CalibrationOptions usual;
  module.def("calibrate", &calibrated, py::arg("views"), py::kw_only(), py::arg("c_arm") = usual.common.c_arm,
             py::arg("ball_covariance_mm2") = py::none(), py::arg("scale_sigma") = usual.common.scale_sigma,
             py::arg("rejection_probability") = usual.rejection_probability,
             py::arg("largest_rms_px") = usual.largest_rms_px,
             R"(Pinhole views by maximum likelihood, all ViewPoints at once, under their priors.

c_arm: CArmPrior that all views share; ball_covariance_mm2: (N, 3, 3), or (3 N, 3 N) of all balls together, mm^2;
scale_sigma: relative, of the calibrator. Outliers are found by tests at rejection_probability (0: none). Returns a
Calibration. Releases the GIL. Raises InputError: bad_value; RefusedError: too_few_fiducials, coplanar_fiducials, behind_source, uncertain, residual_too_large.)");
}

}  // namespace helicarm::python
