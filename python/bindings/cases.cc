// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include "arrays.h"
#include "checks.h"
#include "held_calibration.h"
#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/case_registration/dicom_measurements.h"
#include "helicarm/core/files.h"
#include "helicarm/pipeline/c_arm.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/report/earlier_results.h"
#include "helicarm/report/overlay.h"
#include "helicarm/report/rectified_image.h"
#include "helicarm/report/report.h"
#include "helicarm/simulation/ball_sizes.h"
#include "helicarm/simulation/rotation.h"
#include "helicarm/simulation/truth_json.h"
#include "helicarm/simulation/write_case.h"
#include "helicarm/volume/hounsfield.h"
#include "helicarm/volume/read_volume.h"
#include "measuring_options.h"
#include "module.h"
#include "options.h"
#include "signals.h"

namespace helicarm::python {
namespace {

std::size_t index_of(const pipeline::Result& result, const ViewKey& key) {
  for (std::size_t i = 0; i < result.views.size(); ++i)
    if (key == ViewKey(i) || key == ViewKey(result.views[i].name)) return i;
  std::vector<std::string> names;
  for (const pipeline::ViewResult& view : result.views) names.push_back(view.name);
  raise({Reason::bad_value, fmt::format("view: the result has only {}", fmt::join(names, ", ")), {}, {}});
}

case_registration::Measurement run(const std::filesystem::path& folder, const std::string& method,
                                   std::optional<double> max_error_mm, double motion_sigma_mm,
                                   double search_mm, double search_deg, unsigned threads,
                                   const std::optional<std::filesystem::path>& history,
                                   const py::object& cache, const py::object& progress) {
  const case_registration::RegisterOptions options =
      measuring_options("run_case", method, max_error_mm, motion_sigma_mm, search_mm, search_deg, threads,
                        history, cache, true);
  if (history) value_or_raise(calibration::check_history_file(*history));
  const RunHooks hooks = run_hooks(progress);
  case_registration::Measurement measured = value_or_raise(without_gil([&] {
    return pipeline::read_case(folder).and_then([&](const pipeline::Case& the_case) {
      return case_registration::measure_case(the_case, options, progress_of(hooks));
    });
  }));
  if (measured.result.failure) raise(*measured.result.failure, py::cast(measured));
  if (history && value_or_raise(pipeline::add_to_record(*history, measured.result)).is_new)
    warn({{Reason::missing_file,
           fmt::format("{} did not exist: the record of this C-arm begins with this case", history->string()),
           {},
           {}}});
  return measured;
}

HeldCalibration calibration_of(const pipeline::Result& result) {
  HeldCalibration held;
  if (result.calibration) static_cast<calibration::Calibration&>(held) = *result.calibration;
  held.warnings.assign(result.warnings.begin(), result.warnings.end());
  for (const pipeline::ViewResult& view : result.views) {
    if (!view.calibrated || !view.rectification || !view.found)
      raise({result.failure ? result.failure->reason : Reason::too_few_fiducials,
             "the views were not calibrated",
             {},
             {}});
    held.maps.emplace_back(view.rectification->map);
    held.calibrator_from_bone.push_back(view.calibrator_from_bone);
  }
  return held;
}

void write(const case_registration::Measurement& measured, const std::filesystem::path& folder,
           const std::optional<std::filesystem::path>& dicom) {
  value_or_raise(check_can_write(folder));
  const auto written = without_gil([&] {
    report::forget_results(folder);
    return case_registration::write_models(measured.registration, folder)
        .and_then([&]() -> Expected<void> {
          if (!dicom || measured.result.failure) return {};
          return pipeline::read_case(*dicom).and_then([&](const pipeline::Case& the_case) {
            return case_registration::write_dicom_results(the_case, measured, folder, folder / "registration")
                .map([](const auto&) {});
          });
        })
        .and_then([&] { return report::write_result(measured.result, folder); });
  });
  value_or_raise(written);
}

py::object simulate(const std::filesystem::path& folder, std::uint64_t seed, const std::string& kind,
                    const std::optional<std::string>& preset, int size, int bits, bool knee,
                    const std::vector<std::string>& faults, const std::vector<std::string>& views,
                    const std::optional<std::filesystem::path>& ct, std::optional<int> run,
                    std::optional<double> arc_deg, std::optional<double> flex_mm,
                    std::optional<double> jitter_mm, std::optional<std::uint64_t> arm_seed,
                    unsigned threads) {
  using namespace simulation;
  if (!run && (arc_deg || flex_mm || jitter_mm))
    raise({Reason::usage, "simulate_case: arc_deg, flex_mm and jitter_mm are of a run", {}, {}});
  SimulationOptions options;
  options.seed = seed;
  options.kind = value_or_raise(case_kind(kind));
  if (preset) options.preset = value_or_raise(simulation::preset(*preset));
  options.size = size;
  options.bits = bits;
  options.knee = knee;
  options.arm_seed = arm_seed;
  options.threads = threads;
  constexpr std::string_view lost = "lost:";
  for (const std::string& word : faults)
    if (word.starts_with(lost))
      options.lost_balls.push_back(word.substr(lost.size()));
    else
      options.faults.push_back(value_or_raise(fault(word)));
  for (const std::string& word : views) options.views.push_back(value_or_raise(view_angles(word)));
  if (ct) {
    CtOptions body;
    body.volume = value_or_raise(volume::read_volume(*ct));
    body.name = ct->filename().string();
    warn(value_or_raise(volume::check_hounsfield(body.volume, body.name)));
    options.ct = std::make_shared<const CtOptions>(std::move(body));
  }
  value_or_raise(check_case_folder(folder));
  std::vector<Warning> warnings;
  const auto simulated = without_gil([&]() -> Expected<Json> {
    if (run) {
      Rotation rotation{.frames = *run, .flex_mm = flex_mm};
      rotation.arc_deg = arc_deg.value_or(rotation.arc_deg);
      rotation.jitter_mm = jitter_mm.value_or(rotation.jitter_mm);
      return simulate_run(options, rotation).and_then([&](const SimulatedRun& images) {
        warnings = ball_size_warnings(images.images);
        return write_run(folder, images).map([&] { return truth_json(images); });
      });
    }
    return simulate_case(options).and_then([&](const SimulatedCase& images) {
      warnings = ball_size_warnings(images);
      return write_case(folder, images).map([&] { return truth_json(images); });
    });
  });
  warn(warnings);
  return python_from(value_or_raise(simulated));
}

py::object place_array(const guidance::Place* place) {
  return vector_array<3>(place ? std::optional<Eigen::Vector3d>(place->point()) : std::nullopt);
}

py::dict bone_places(const guidance::PointInFrames& point) {
  py::dict places;
  for (const auto& [bone, place] : point.in_bones) {
    py::dict at;
    at["xyz_mm"] = place_array(&place);
    at["covariance_mm2"] = read_only(matrix_array(place.covariance));
    at["error_95_mm"] = localization::length_at_95(place.covariance);
    places[bone.c_str()] = at;
  }
  return places;
}

void add_result_points(py::module_& module) {
  using Point = pipeline::PointResult;
  const auto of_place = [](auto get) {
    return [get](const Point& p) -> py::object { return p.place ? get(*p.place) : py::none(); };
  };
  py::class_<Point>(module, "ResultPoint",
                    "A pick or check target of a case: its position, or why it was not located.")
      .def_readonly("name", &Point::name)
      .def_property_readonly("source", [](const Point& p) { return word(p.source); })
      .def_property_readonly(
          "xyz_mm", of_place([](const guidance::PointInFrames& g) -> py::object {
            return read_only(rows_array<3>({g.in_calibrator}, true));
          }),
          "(3,) calibrator frame at the first view's moment, mm; None where it was not located.")
      .def_property_readonly("covariance_mm2", of_place([](const guidance::PointInFrames& g) -> py::object {
                               return read_only(matrix_array(g.covariance_in_calibrator));
                             }),
                             "(3, 3) mm^2, axes of the calibrator frame; or None.")
      .def_property_readonly(
          "error_95_mm", of_place([](const guidance::PointInFrames& g) -> py::object {
            return py::float_(localization::length_at_95(g.covariance_in_calibrator));
          }),
          "Distance from the true point that 95 % of such points do not exceed, mm; or None.")
      .def_property_readonly(
          "in_bones", [](const Point& p) { return p.place ? bone_places(*p.place) : py::dict(); },
          "Of each bone in which it is known: {xyz_mm, covariance_mm2, error_95_mm}.")
      .def_property_readonly("in_femur_mm", of_place([](const guidance::PointInFrames& g) {
                               return place_array(g.in("femur"));
                             }),
                             "(3,) or None.")
      .def_property_readonly("in_tibia_mm", of_place([](const guidance::PointInFrames& g) {
                               return place_array(g.in("tibia"));
                             }),
                             "(3,) or None.")
      .def_property_readonly("in_tool_mm", of_place([](const guidance::PointInFrames& g) {
                               return place_array(g.in_tool ? &*g.in_tool : nullptr);
                             }),
                             "(3,) or None.")
      .def_readonly("ray_gap_mm", &Point::ray_gap_mm)
      .def_property_readonly(
          "reason",
          [](const Point& p) {
            return p.reason ? py::object(warning_dict(*p.reason)) : py::object(py::none());
          },
          "Why it was not located: {code, message, view, figures}; else None.")
      .def_property_readonly(
          "warnings", [](const Point& p) { return warning_list(p.warnings); },
          "List of {code, message, view, figures}.")
      .def("__repr__", [](const Point& p) {
        if (!p.place)
          return fmt::format("<ResultPoint {}: not located{}>", p.name,
                             p.reason ? fmt::format(", {}", code(p.reason->reason)) : "");
        const Eigen::Vector3d& at = p.place->in_calibrator;
        std::string warnings;
        for (const Warning& warning : p.warnings)
          warnings += fmt::format(", warning {}", code(warning.reason));
        return fmt::format("<ResultPoint {}: {:.3f} {:.3f} {:.3f} mm, within {:.3f} mm (95 %){}>", p.name,
                           at.x(), at.y(), at.z(),
                           localization::length_at_95(p.place->covariance_in_calibrator), warnings);
      });
}

void add_result(py::module_& module) {
  using case_registration::Measurement;
  py::class_<Measurement>(module, "Result", "The answer of run_case; to_dict() is result.json.")
      .def_property_readonly("status",
                             [](const Measurement& m) { return m.result.failure ? "refused" : "ok"; })
      .def_property_readonly("warnings", [](const Measurement& m) { return warning_list(m.result.warnings); })
      .def_property_readonly(
          "names",
          [](const Measurement& m) {
            std::vector<std::string> names;
            for (const pipeline::ViewResult& view : m.result.views) names.push_back(view.name);
            return names;
          },
          "Of the views.")
      .def_property_readonly(
          "points", [](const Measurement& m) { return m.result.points; },
          "List of ResultPoint: picks, then check targets.")
      .def_property_readonly(
          "registration",
          [](const Measurement& m) {
            return m.registration ? python_from(case_registration::to_json(*m.registration)) : py::none();
          },
          "The content of registration.json; None where the case has no models or was refused before.")
      .def(
          "point",
          [](const Measurement& m, const std::string& name) {
            for (const pipeline::PointResult& point : m.result.points)
              if (point.name == name) return point;
            raise({Reason::bad_value, fmt::format("no point \"{}\"", name), {}, {}});
          },
          py::arg("name"))
      .def_property_readonly(
          "calibration", [](const Measurement& m) { return calibration_of(m.result); },
          "Calibration; RefusedError where it was not reached.")
      .def(
          "image",
          [](const Measurement& m, const ViewKey& key) {
            return std::const_pointer_cast<xray::XrayImage>(
                m.result.views[index_of(m.result, key)].xray_image);
          },
          py::arg("view"), "The view's XrayImage, not copied; None where it was not read.")
      .def(
          "rectified_image",
          [](const Measurement& m, const ViewKey& key) {
            const pipeline::ViewResult& view = m.result.views[index_of(m.result, key)];
            if (!view.xray_image) raise({Reason::missing_file, "the image was not read", view.name, {}});
            return moved_to_array(without_gil([&] { return report::rectified_image(view); }));
          },
          py::arg("view"), "(height, width) uint8: rectified and windowed for the eye.")
      .def(
          "overlay_png",
          [](const Measurement& m, const ViewKey& key) {
            const std::size_t view = index_of(m.result, key);
            return py::bytes(without_gil([&] { return report::overlay_png(m.result, view); }));
          },
          py::arg("view"), "PNG file content: fiducials, points, planned tunnels on the rectified image.")
      .def(
          "to_dict", [](const Measurement& m) { return python_from(pipeline::to_json(m.result)); },
          "The content of result.json.")
      .def("write", &write, py::arg("folder"), py::kw_only(), py::arg("dicom") = py::none(),
           "result.json, report.html and an overlay PNG for each view; of a case with models also "
           "registration.json and\n"
           "registration/. dicom: the case's folder: also measurements.dcm, a DICOM measurement report, and\n"
           "DICOM registrations, as `helicarm run --dicom`. What an earlier result left in the folder is "
           "removed.\n"
           "Raises InputError: cannot_write, bad_value where the case's images are not those measured or\n"
           "neither they nor a CT are DICOM files; RefusedError: patient_mismatch.")
      .def("__repr__", [](const Measurement& m) {
        const pipeline::Result& r = m.result;
        if (r.failure) return fmt::format("<Result: refused, {}>", code(r.failure->reason));
        const auto located = std::ranges::count_if(
            r.points, [](const pipeline::PointResult& point) { return point.place.has_value(); });
        std::string text = fmt::format("<Result: {} views, {} of {} points located", r.views.size(), located,
                                       r.points.size());
        for (const Warning& warning : r.warnings) text += fmt::format(", warning {}", code(warning.reason));
        return text + ">";
      });
}

}  // namespace

void add_cases(py::module_& module) {
  add_result_points(module);
  add_result(module);
  const case_registration::RegisterOptions searched;
  const pipeline::RunOptions& usual = searched.run;
  module.def(
      "run_case", &run, py::arg("folder"), py::kw_only(), py::arg("method") = std::string(word(usual.method)),
      py::arg("max_error_mm") = usual.max_error_mm, py::arg("motion_sigma_mm") = usual.motion_sigma_mm,
      py::arg("search_mm") = searched.search.shift_mm, py::arg("search_deg") = searched.search.turn_deg,
      py::arg("threads") = usual.threads, py::arg("history") = py::none(), py::arg("cache") = true,
      py::arg("progress") = py::none(),
      R"(Measures a case: X-ray images to cameras, and of two or more to points with confidence regions, tunnels and diagnostics, as
`helicarm run` does; a case's models are registered too.

folder: holds case.json. method: best, or paper. max_error_mm: refuse (uncertain) where a point, or a point of a model
or of its plan, may be off by more (95 %). motion_sigma_mm: standard deviation per axis of the motion of an untracked
bone or model between the acquisitions. search_mm, search_deg: about each model's start, per axis. history: a C-arm's history
file, which serves as prior and to which this case is added unless it is refused; made where there is none. cache: a
folder that keeps the distortion maps of plate images, True for the user's cache folder, False for none. progress:
called with the name of each stage (read, rectify, detect, label, calibrate, locate) before it begins, and, if it has a
parameter share, with name and share while models are searched for, as register does; an exception from it ends the run,
and Ctrl-C does between two views. Releases the GIL. Returns a Result.
Raises InputError; RefusedError with .result, which holds all that was computed until then.)");
  const simulation::SimulationOptions usual_simulation;
  module.def(
      "simulate_case", &simulate, py::arg("folder"), py::kw_only(), py::arg("seed") = usual_simulation.seed,
      py::arg("kind") = std::string(simulation::word(usual_simulation.kind)), py::arg("preset") = py::none(),
      py::arg("size") = usual_simulation.size, py::arg("bits") = usual_simulation.bits,
      py::arg("knee") = usual_simulation.knee, py::arg("faults") = std::vector<std::string>(),
      py::arg("views") = std::vector<std::string>(), py::arg("ct") = py::none(), py::arg("run") = py::none(),
      py::arg("arc_deg") = py::none(), py::arg("flex_mm") = py::none(), py::arg("jitter_mm") = py::none(),
      py::arg("arm_seed") = py::none(), py::arg("threads") = usual_simulation.threads,
      R"(Writes a simulated case (images, case.json, calibrator.json, plate.json, truth.json) into a folder.

The same seed gives the same bytes. kind: accuracy, tunnels, flat or grid; preset: paper-sim, ii-9in or flat-panel;
size: 512 or 1024 pixels; faults ("lost:P4": without this ball), views (NAME:PRIMARY,SECONDARY in degrees) and ct as
`helicarm simulate`; arm_seed: of the C-arm (None: seed). run: a rotation of this many images for sweep instead, of 256 pixels too, over
arc_deg, with sag up to flex_mm and jitter_mm of each image (None: as `helicarm simulate --run`). Releases the GIL.
Returns the content of truth.json. Raises InputError: usage, bad_value, cannot_write.)");
}

}  // namespace helicarm::python
