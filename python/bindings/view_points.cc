// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <iterator>
#include <memory>

#include "arrays.h"
#include "checks.h"
#include "held_calibration.h"
#include "helicarm/calibration/labelled_views.h"
#include "helicarm/calibration/solve_view.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/fiducials/find_target.h"
#include "helicarm/fiducials/status_words.h"
#include "helicarm/phantom/calibrator_limits.h"
#include "helicarm/pipeline/prior.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/pipeline/stages.h"
#include "module.h"
#include "options.h"

namespace helicarm::python {
namespace {

using Pair = std::optional<std::pair<double, double>>;
using fiducials::FiducialStatus;

std::optional<geometry::NormalPrior> normal_prior(const Pair& pair, const Limits& limits,
                                                  const std::string& argument) {
  if (!pair) return std::nullopt;
  return geometry::NormalPrior{checked(pair->first, limits, argument + ": value"),
                               checked(pair->second, positive, argument + ": sigma")};
}

geometry::IntrinsicsPrior intrinsics_prior(std::optional<double> focal_px,
                                           const std::optional<Doubles>& principal_px, double unit_px,
                                           const Pair& aspect, const Pair& skew) {
  geometry::IntrinsicsPrior prior;
  prior.focal_px = checked(focal_px, positive, "focal_px");
  if (principal_px) prior.principal_px = row_of<2>(*principal_px, "principal_px");
  prior.unit_px = checked(unit_px, positive, "unit_px");
  prior.aspect = normal_prior(aspect, positive, "aspect");
  prior.skew = normal_prior(skew, any_number, "skew");
  return prior;
}

std::optional<calibration::IntrinsicsVariation> variation(const Pair& pair, const std::string& argument) {
  if (!pair) return std::nullopt;
  return calibration::IntrinsicsVariation{checked(pair->first, not_negative, argument + ": common"),
                                          checked(pair->second, positive, argument + ": of each view")};
}

std::string words_of(const std::optional<geometry::NormalPrior>& prior) {
  return prior ? fmt::format("({:g}, {:g})", prior->value, prior->sigma) : "None";
}
std::string words_of(const std::optional<calibration::IntrinsicsVariation>& variation) {
  return variation ? fmt::format("({:g}, {:g})", variation->common, variation->of_view) : "None";
}
std::string words_of(const geometry::IntrinsicsPrior& prior) {
  const std::string focal = prior.focal_px ? fmt::format("{:g}", *prior.focal_px) : "None";
  const std::string principal =
      prior.principal_px ? fmt::format("({:g}, {:g})", prior.principal_px->x(), prior.principal_px->y())
                         : "None";
  return fmt::format("IntrinsicsPrior(focal_px={}, principal_px={}, unit_px={:g}, aspect={}, skew={})", focal,
                     principal, prior.unit_px, words_of(prior.aspect), words_of(prior.skew));
}

void check_extent(const std::vector<fiducials::Fiducial>& points, const std::string& view) {
  if (points.size() < 2) return;
  Eigen::Vector3d low = points[0].centre_in_calibrator, high = low;
  for (const fiducials::Fiducial& point : points) {
    low = low.cwiseMin(point.centre_in_calibrator);
    high = high.cwiseMax(point.centre_in_calibrator);
  }
  const double extent = (high - low).maxCoeff();
  if (extent < phantom::least_extent_mm)
    raise(
        {Reason::bad_value,
         fmt::format("xyz_mm: the points extend over {:g} mm, at least {:g} mm are required; check the unit "
                     "(metres?)",
                     extent, phantom::least_extent_mm),
         view,
         {{"value", extent}, {"limit", phantom::least_extent_mm}}});
}

/// One number, or one for each point.
std::vector<double> sigmas_of(const Doubles& sigma_px, std::size_t count, const std::string& view) {
  if (sigma_px.ndim() != 0 && (sigma_px.ndim() != 1 || std::size_t(sigma_px.size()) != count))
    raise({Reason::bad_value,
           fmt::format("sigma_px: shape {} is neither () nor ({},)", shape_of(sigma_px), count),
           view,
           {}});
  std::vector<double> sigmas;
  for (std::size_t i = 0; i < count; ++i)
    sigmas.push_back(checked(sigma_px.data()[sigma_px.ndim() == 0 ? 0 : i], positive, "sigma_px", view));
  return sigmas;
}

/// Free of distortion, or raw and carried through the map, whose error is added.
fiducials::ImagePoint image_point(const Eigen::Vector2d& uv, double sigma_px,
                                  const std::optional<rectification::DistortionMap>& map,
                                  const std::string& view) {
  if (!map) return {uv, uv, sigma_px};
  auto seen = fiducials::point_of_click(*map, uv, sigma_px);
  if (seen) return *seen;
  Failure failure = std::move(seen).error();
  failure.view = view;
  raise(failure);
}

void check_map_share(const ViewPoints& view) {
  for (std::size_t i = 0; i < view.fiducials.size(); ++i) {
    constexpr double rounding = 1e-6;
    const double variance = view.fiducials[i].sigma_px * view.fiducials[i].sigma_px;
    const double by_map = view.map_covariance_px2(Eigen::Index(i), Eigen::Index(i));
    if (by_map > (1 + rounding) * variance)
      raise({Reason::bad_value,
             fmt::format("map_covariance_px2: the variance of {} is {:g} px^2, more than sigma_px^2 of {:g}: "
                         "sigma_px must contain the map's error",
                         view.fiducials[i].label, by_map, variance),
             view.name,
             {{"value", by_map}, {"limit", variance}}});
  }
}

using GivenLabels = std::optional<std::vector<std::string>>;

std::vector<fiducials::Fiducial> points_of(const std::string& name, const Doubles& xyz_mm, const Doubles& uv,
                                           const Doubles& sigma_px, const GivenLabels& labels,
                                           const std::optional<rectification::DistortionMap>& map) {
  const auto points = rows_of<3>(xyz_mm, "xyz_mm", name);
  const auto pixels = rows_of<2>(uv, "uv", name);
  const std::size_t n = points.size();
  if (pixels.size() != n || (labels && labels->size() != n))
    raise({Reason::bad_value,
           fmt::format("xyz_mm, uv and labels differ in length: {}, {} and {}", n, pixels.size(),
                       labels ? labels->size() : n),
           name,
           {}});
  const std::vector<double> sigmas = sigmas_of(sigma_px, n, name);
  std::vector<fiducials::Fiducial> made;
  for (std::size_t i = 0; i < n; ++i) {
    const auto [raw, rectified, sigma] = image_point(pixels[i], sigmas[i], map, name);
    fiducials::Fiducial& point = made.emplace_back(fiducials::Fiducial{
        labels ? (*labels)[i] : fmt::format("P{}", i + 1), points[i], FiducialStatus::used, raw, rectified});
    point.sigma_px = sigma;
  }
  return made;
}

ViewPoints view_points(const std::string& name, const Doubles& xyz_mm, const Doubles& uv,
                       const Doubles& sigma_px, const GivenLabels& labels,
                       const geometry::IntrinsicsPrior& prior,
                       const std::optional<Doubles>& map_covariance_px2,
                       const std::optional<rectification::DistortionMap>& map, std::optional<bool> mirrored) {
  if (map && map_covariance_px2)
    raise({Reason::usage, "map_covariance_px2: is computed from the map; give one of them", name, {}});
  ViewPoints view{{name, points_of(name, xyz_mm, uv, sigma_px, labels, map), prior, {}, {}}, mirrored, map};
  check_extent(view.fiducials, name);
  std::vector<Eigen::Vector2d> places;
  for (const fiducials::Fiducial& point : view.fiducials) places.push_back(point.uv);
  if (map) view.map_covariance_px2 = map->covariance_px2(places);
  if (!map_covariance_px2) return view;
  const auto size = py::ssize_t(view.fiducials.size());
  view.map_covariance_px2 = checked_covariance(
      matrix_of(*map_covariance_px2, size, size, "map_covariance_px2", name), "map_covariance_px2", name);
  check_map_share(view);
  return view;
}

py::dict solved(const Doubles& xyz_mm, const Doubles& uv, const std::optional<Doubles>& sigma_px,
                const GivenLabels& labels, const std::string& method) {
  const auto how = value_or_raise(calibration::solve_method(method, "method"));
  const auto points =
      points_of("", xyz_mm, uv, sigma_px ? *sigma_px : Doubles(py::object(py::float_(1.0))), labels, {});
  value_or_raise(calibration::aligned_by_label({{"", points}}));
  const auto made = value_or_raise(without_gil([&] {
    return calibration::solve_view(points, how, sigma_px.has_value(), {"xyz_mm", "the points"});
  }));
  exchange::ImportedMatrix camera;
  camera.view = made.view;
  std::ranges::copy_if(made.warnings, std::back_inserter(camera.warnings), [](const Warning& warning) {
    return warning.reason == Reason::ambiguous_handedness;  // the others are of the points
  });
  py::dict answer;
  answer["camera"] = camera;
  answer["dlt"] = made.dlt ? py::object(rows_array<11>({*made.dlt}, true)) : py::object(py::none());
  answer["covariance"] =
      made.covariance ? py::object(matrix_array(*made.covariance)) : py::object(py::none());
  answer["reprojection_rms_px"] = made.reprojection_rms_px;
  answer["condition"] = made.condition;
  answer["warnings"] = warning_list(made.warnings);
  return answer;
}

using GivenMap = std::variant<std::monostate, rectification::Rectification, rectification::DistortionMap>;

Expected<rectification::Rectification> rectification_of(pipeline::DetectedView& view,
                                                        const GivenMap& source) {
  if (const auto* whole = std::get_if<rectification::Rectification>(&source)) {
    detection::dots_of(view.dots, *view.xray_image, whole->metal);
    return *whole;
  }
  const auto* map = std::get_if<rectification::DistortionMap>(&source);
  return rectification::with_map(*view.xray_image, view.dots,
                                 map ? *map : rectification::flat_panel_map(*view.xray_image), std::nullopt);
}

/// The stages of a run for one image.
pipeline::OrRefusal<std::vector<pipeline::LabelledView>> labelled_views(
    const std::shared_ptr<xray::XrayImage>& image, const GivenMap& map, const pipeline::Case& the_case,
    const pipeline::RunOptions& options) {
  return pipeline::detect_in_views({{{image->name}, image}}, the_case, options)
      .and_then([&](auto detected) -> pipeline::OrRefusal<std::vector<pipeline::LabelledView>> {
        auto rectification = rectification_of(detected.front(), map);
        if (!rectification) {
          rectification.error().view = image->name;
          return tl::unexpected(pipeline::Refusal{rectification.error(), pipeline::Stage::rectify, {}});
        }
        return pipeline::label_views({{std::move(detected.front()), *std::move(rectification)}}, the_case,
                                     options);
      });
}

ViewPoints labelled(const std::shared_ptr<xray::XrayImage>& image, const phantom::Calibrator& calibrator,
                    const GivenMap& map, std::optional<bool> mirrored, const std::string& method) {
  pipeline::RunOptions options;
  options.method = method_of(method);
  pipeline::Case the_case;
  the_case.calibrator = calibrator;
  the_case.views.emplace_back().mirrored = mirrored;
  const auto views = without_gil([&] { return labelled_views(image, map, the_case, options); });
  if (!views) raise(views.error().failure);
  const pipeline::LabelledView& view = views->front();
  const bool explained = view.fiducials.mirrored && image->acquisition.flip_hint;
  return {pipeline::fiducials_of(view), explained && !mirrored ? std::optional(true) : mirrored,
          view.rectification.map};
}

void add_priors(py::module_& module) {
  const geometry::IntrinsicsPrior usual;
  const auto pair_of = [](const std::optional<geometry::NormalPrior>& prior) -> Pair {
    if (!prior) return std::nullopt;
    return std::pair(prior->value, prior->sigma);
  };
  py::class_<geometry::IntrinsicsPrior>(
      module, "IntrinsicsPrior",
      R"(What is known of one view's intrinsics beforehand, rectified pixels.

focal_px: nominal mean of |fx| and fy: source distance (mm) / pixel (mm); principal_px: (u, v), such as the image's
centre; unit_px: the unit of CArmPrior in this view: px per mm on the receiver (1 / pixel), or 1 for a CArmPrior in
pixels; aspect: (value, sigma) of |fx| / fy; skew: (value, sigma) over fy, None: free.
Raises InputError: bad_value, not_finite.)")
      .def(py::init(&intrinsics_prior), py::kw_only(), py::arg("focal_px") = usual.focal_px,
           py::arg("principal_px") = py::none(), py::arg("unit_px") = usual.unit_px,
           py::arg("aspect") = pair_of(usual.aspect), py::arg("skew") = pair_of(usual.skew))
      .def("__repr__", [](const geometry::IntrinsicsPrior& prior) { return words_of(prior); });
  py::class_<calibration::CArmPrior>(module, "CArmPrior",
                                     R"(How far a C-arm's intrinsics may be from nominal: standard deviations.

focal, principal: (common to all views, of each view: sag), in units of IntrinsicsPrior.unit_px; None: not known.
Raises InputError: bad_value, not_finite.)")
      .def(py::init([](const Pair& focal, const Pair& principal) {
             return calibration::CArmPrior{variation(focal, "focal"), variation(principal, "principal")};
           }),
           py::kw_only(), py::arg("focal") = py::none(), py::arg("principal") = py::none())
      .def_static("unknown", &pipeline::unknown_c_arm,
                  "Of a C-arm without history, in mm on the receiver, as run_case assumes it.")
      .def("__repr__", [](const calibration::CArmPrior& prior) {
        return fmt::format("CArmPrior(focal={}, principal={})", words_of(prior.focal),
                           words_of(prior.principal));
      });
}

}  // namespace

py::list fiducial_list(const std::vector<fiducials::Fiducial>& fiducials) {
  py::list list;
  for (const fiducials::Fiducial& fiducial : fiducials) {
    const bool seen = fiducial.status == FiducialStatus::used || fiducial.status == FiducialStatus::rejected;
    const auto pixel = [&](const Eigen::Vector2d& uv) {
      return seen ? py::object(rows_array<2>({uv}, true)) : py::object(py::none());
    };
    py::dict one;
    one["label"] = fiducial.label;
    one["status"] = fiducials::word(fiducial.status);
    one["xyz_mm"] = rows_array<3>({fiducial.centre_in_calibrator}, true);
    one["uv_raw"] = pixel(fiducial.uv_raw);
    one["uv"] = pixel(fiducial.uv);
    one["sigma_px"] = seen ? py::object(py::float_(fiducial.sigma_px)) : py::none();
    one["residual_px"] = seen ? py::object(py::float_(fiducial.residual_px)) : py::none();
    list.append(one);
  }
  return list;
}

void add_view_points(py::module_& module) {
  module.def("_solve", &solved);
  add_priors(module);
  const auto count_used = [](const ViewPoints& view) {
    return std::size_t(
        std::ranges::count(view.fiducials, FiducialStatus::used, &fiducials::Fiducial::status));
  };
  py::class_<ViewPoints>(module, "ViewPoints",
                         R"(Labelled image points of one view, for calibrate.

ViewPoints(name, xyz_mm, uv, *, sigma_px, labels=None, prior=IntrinsicsPrior(), map_covariance_px2=None, map=None,
           mirrored=None)
  xyz_mm: (N, 3) world, mm; uv: (N, 2) pixels free of distortion, or raw ones with map
  sigma_px: per axis, one number or (N,), above 0; without map it contains the map's error
  labels: N names, which say what is the same ball in several views; not given: P1, P2, ... by row
  prior: IntrinsicsPrior; map_covariance_px2: (N, N) covariance per axis that the points share, already in sigma_px
  map: DistortionMap of the image: rectifies uv, adds its own error and covariance, and serves raw=True of Calibration
  mirrored: whether the image is mirrored, where it is known
Raises InputError: bad_value, not_finite, usage; RefusedError: not_seen for raw points off the image.)")
      .def(py::init(&view_points), py::arg("name"), py::arg("xyz_mm"), py::arg("uv"), py::kw_only(),
           py::arg("sigma_px"), py::arg("labels") = py::none(),
           py::arg("prior") = geometry::IntrinsicsPrior(), py::arg("map_covariance_px2") = py::none(),
           py::arg("map") = py::none(), py::arg("mirrored") = py::none())
      .def_readonly("name", &ViewPoints::name)
      .def_readonly("map", &ViewPoints::map, "DistortionMap, or None.")
      .def_readonly("mirrored", &ViewPoints::mirrored, "As stated, or None.")
      .def_readonly("prior", &ViewPoints::prior, "IntrinsicsPrior")
      .def_property_readonly(
          "fiducials", [](const ViewPoints& view) { return fiducial_list(view.fiducials); },
          "List of {label, status, xyz_mm, uv_raw, uv, sigma_px, residual_px}; only those \"used\" enter.")
      .def("__len__", count_used)
      .def("__repr__", [=](const ViewPoints& view) {
        return fmt::format("<ViewPoints {}: {} points{}>", view.name, count_used(view),
                           view.map ? ", with map" : "");
      });
  module.def(
      "label", &labelled, py::arg("image"), py::arg("calibrator"), py::arg("map") = py::none(), py::kw_only(),
      py::arg("mirrored") = py::none(), py::arg("method") = std::string(rectification::method_words[0]),
      R"(Finds a calibrator's balls in an image, labels them and measures their centres, as run_case does (2.3.4).

map: the Rectification of this image, the DistortionMap of a plate's own image, or None for a flat panel. mirrored:
whether the image is mirrored, where it is known. Returns ViewPoints under the image's name, with the prior from its
file; calibrate then takes c_arm=CArmPrior.unknown(). Releases the GIL. Raises RefusedError: too_few_fiducials,
ambiguous_labels, calibrator_mismatch, blank_image, saturated, plate_mismatch (also for a plate of the other kind).)");
}

}  // namespace helicarm::python
