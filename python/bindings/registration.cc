// SPDX-License-Identifier: Apache-2.0
#include <limits>
#include <variant>

#include "arrays.h"
#include "helicarm/case_registration/dicom_measurements.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/core/files.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/registration/follow.h"
#include "helicarm/report/earlier_results.h"
#include "helicarm/track/model_sequence.h"
#include "measuring_options.h"
#include "module.h"
#include "signals.h"

namespace helicarm::python {
namespace {

using registration::Registration;

py::object register_models(const std::filesystem::path& folder,
                           const std::optional<std::filesystem::path>& out, bool dicom,
                           const std::string& method, std::optional<double> max_error_mm,
                           double motion_sigma_mm, double search_mm, double search_deg, unsigned threads,
                           const std::optional<std::filesystem::path>& history, const py::object& cache,
                           const py::object& progress) {
  if (dicom && !out) raise({Reason::usage, "register: dicom=True requires out", {}, {}});
  const auto options = measuring_options("register", method, max_error_mm, motion_sigma_mm, search_mm,
                                         search_deg, threads, history, cache);
  const RunHooks hooks = run_hooks(progress);
  if (out) value_or_raise(check_can_write(*out));
  if (out) report::forget_registration(*out);
  const auto result = value_or_raise(without_gil([&] {
    pipeline::Case the_case;
    return pipeline::read_case(folder, pipeline::Purpose::registration)
        .and_then([&](pipeline::Case given) {
          the_case = std::move(given);
          return case_registration::register_case(the_case, options, progress_of(hooks));
        })
        .and_then([&](case_registration::CaseRegistration made) {
          auto written = out ? case_registration::write_registration(made, *out) : Expected<void>{};
          if (written && dicom && !made.failure)
            written = case_registration::write_dicom_results(
                          the_case, {case_registration::with_models({}, made), made}, *out, *out)
                          .map([](const auto&) {});
          return written.map([&] { return std::move(made); });
        });
  }));
  py::object answer = python_from(case_registration::to_json(result));
  if (result.failure) raise(*result.failure, answer);
  for (const case_registration::RegisteredModel& model : result.models)
    if (model.registration.failure) raise(*model.registration.failure, answer);
  return answer;
}

/// "A-B[:STEP]", or numbers such as a range.
using Frames = std::variant<std::string, py::sequence>;

case_registration::FrameRange frames_from(const Frames& frames) {
  if (const auto* text = std::get_if<std::string>(&frames))
    return value_or_raise(case_registration::frame_range_from(*text));
  const auto& sequence = std::get<py::sequence>(frames);
  constexpr std::size_t most = 1'000'000;
  if (sequence.empty() || sequence.size() > most)
    raise({Reason::bad_value,
           fmt::format("frames: has {} numbers, 1 to {} are possible", sequence.size(), most),
           {},
           {}});
  const auto numbers = sequence.cast<std::vector<std::int64_t>>();
  for (const std::int64_t number : numbers)
    if (number < 0 || number >= std::int64_t(most))
      raise({Reason::bad_value, fmt::format("frames: {} is outside 0 to {}", number, most - 1), {}, {}});
  const std::int64_t step = numbers.size() > 1 ? numbers[1] - numbers[0] : 1;
  for (std::size_t i = 1; i < numbers.size(); ++i)
    if (step < 1 || numbers[i] - numbers[i - 1] != step)
      raise({Reason::bad_value, "frames: the numbers do not rise in equal steps", {}, {}});
  return value_or_raise(
      case_registration::frame_range_from(fmt::format("{}-{}:{}", numbers.front(), numbers.back(), step)));
}

/// (N, rows, columns)
template <class Values, class MatrixOf>
py::array stacked(const Values& values, py::ssize_t rows, py::ssize_t columns, const MatrixOf& matrix_of) {
  py::array_t<double> array({py::ssize_t(values.size()), rows, columns});
  double* at = array.mutable_data();
  for (const auto& value : values) {
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(at, rows, columns) =
        matrix_of(value);
    at += rows * columns;
  }
  return array;
}

/// (N, rows, rows) of frames, NaN without a pose.
template <class MatrixOf>
py::array of_frames(const std::vector<track::TrackedBody>& frames, py::ssize_t rows,
                    const MatrixOf& matrix_of) {
  using Matrix = std::decay_t<decltype(matrix_of(track::FramePose{}))>;
  return stacked(frames, rows, rows, [&](const track::TrackedBody& frame) -> Matrix {
    if (frame.pose) return matrix_of(*frame.pose);
    return Matrix::Constant(std::numeric_limits<double>::quiet_NaN());
  });
}

Eigen::Matrix4d matrix_of_pose(const track::FramePose& frame) { return frame.pose.matrix(); }
registration::RigidCovariance covariance_of_pose(const track::FramePose& frame) { return frame.covariance; }

py::dict poses_of(const track::ModelSequence& sequence, std::size_t model) {
  std::vector<const Registration*> found;
  py::list decisions, codes;
  std::vector<Eigen::Vector3d> centres;
  for (const auto& frame : sequence.registered) {
    const Registration& one = frame.models[model];
    found.push_back(&one);
    centres.push_back(one.centre);
    decisions.append(std::string(registration::word(one.decision)));
    codes.append(one.failure ? py::object(py::str(std::string(code(one.failure->reason)))) : py::none());
  }
  py::dict poses;
  poses["name"] = sequence.names[model];
  poses["world_from_model"] =
      stacked(found, 4, 4, [](const Registration* one) { return one->world_from_model.matrix(); });
  poses["covariance"] = stacked(found, 6, 6, [](const Registration* one) { return one->covariance; });
  poses["centre_mm"] = rows_array<3>(centres);
  poses["decision"] = decisions;
  poses["refused"] = codes;
  const track::BodySequence& body = sequence.bodies[model];
  poses["smoothed"] = of_frames(body.smoothed, 4, matrix_of_pose);
  poses["smoothed_covariance"] = of_frames(body.smoothed, 6, covariance_of_pose);
  return poses;
}

py::dict relative_poses_of(const track::ModelSequence& sequence, std::size_t model) {
  std::vector<registration::RelativePose> found;
  for (const auto& frame : sequence.registered)
    found.push_back(registration::relative_pose(frame.models.front(), frame.models[model]));
  py::dict poses;
  poses["name"] = sequence.names[model];
  poses["reference"] = sequence.names.front();
  poses["reference_from_model"] =
      stacked(found, 4, 4, [](const auto& one) { return one.reference_from_model.matrix(); });
  poses["covariance"] = stacked(found, 6, 6, [](const auto& one) { return one.covariance; });
  poses["smoothed"] = of_frames(sequence.relative[model - 1], 4, matrix_of_pose);
  poses["smoothed_covariance"] = of_frames(sequence.relative[model - 1], 6, covariance_of_pose);
  return poses;
}

py::object register_sequence(const std::filesystem::path& folder, const Frames& frames,
                             const std::optional<std::filesystem::path>& out, bool resume,
                             const std::string& method, std::optional<double> max_error_mm,
                             double motion_sigma_mm, double search_mm, double search_deg, unsigned threads,
                             const std::optional<std::filesystem::path>& history, const py::object& cache,
                             const py::object& progress) {
  const auto options = measuring_options("register_sequence", method, max_error_mm, motion_sigma_mm,
                                         search_mm, search_deg, threads, history, cache);
  const auto range = frames_from(frames);
  const RunHooks hooks = run_hooks(py::none());
  const auto on_frame = [&](double share) {
    hooks.on_view();
    const py::gil_scoped_acquire acquire;
    if (!progress.is_none()) progress(share);
  };
  if (out) value_or_raise(check_can_write(*out));
  if (out && !resume) report::forget_registration(*out);
  const auto sequence = value_or_raise(without_gil([&] {
    return pipeline::read_case(folder, pipeline::Purpose::registration)
        .and_then([&](const pipeline::Case& the_case) {
          return track::follow_models(the_case, range, options, {.out = out, .resume = resume}, on_frame,
                                      {{}, hooks.on_view});
        })
        .and_then([&](track::ModelSequence made) {
          const auto written = out ? track::write_models(made, *out) : Expected<void>{};
          return written.map([&] { return std::move(made); });
        });
  }));
  py::dict answer;
  py::list models, relative;
  for (std::size_t i = 0; i < sequence.names.size(); ++i) {
    models.append(poses_of(sequence, i));
    if (i > 0) relative.append(relative_poses_of(sequence, i));
  }
  answer["frames"] = py::cast(sequence.frames);
  answer["models"] = models;
  answer["relative"] = relative;
  answer["warnings"] = warning_list(sequence.warnings);
  answer["seconds"] = sequence.seconds;
  if (const auto refusal = sequence.refusal()) raise(*refusal, answer);
  return answer;
}

}  // namespace

void add_registration(py::module_& module) {
  const case_registration::RegisterOptions defaults;
  module.def(
      "register", &register_models, py::arg("folder"), py::kw_only(), py::arg("out") = py::none(),
      py::arg("dicom") = false, py::arg("method") = std::string(word(defaults.run.method)),
      py::arg("max_error_mm") = py::none(), py::arg("motion_sigma_mm") = defaults.run.motion_sigma_mm,
      py::arg("search_mm") = defaults.search.shift_mm, py::arg("search_deg") = defaults.search.turn_deg,
      py::arg("threads") = defaults.run.threads, py::arg("history") = py::none(), py::arg("cache") = true,
      py::arg("progress") = py::none(),
      "Register the CT volumes and surfaces of a case (\"models\" of its case.json) to its views, as\n"
      "`helicarm register` does.\n\n"
      "Returns the content of registration.json: for each model world_from_model (4 x 4, mm), covariance\n"
      "(6 x 6: rotation vector, rad, then translation, mm, world axes, about centre_mm), decision, "
      "warnings,\n"
      "points and tunnels of its plan. World: the calibrator's frame, or that of the views' cameras.\n\n"
      "out: folder for registration.json, report.html and overlays, or None. dicom: also measurements.dcm, "
      "a\n"
      "DICOM measurement report with the patient and study of the X-ray images, and MODEL_registration.dcm, "
      "a\n"
      "DICOM Spatial Registration with those of the CT (a folder of a DICOM series). method, "
      "motion_sigma_mm,\n"
      "history: as run_case, the history is only read. max_error_mm: refuse where a point of the model or "
      "its\n"
      "plan may be off by more (95 %). search_mm, search_deg: searched about each start, per axis. threads: "
      "0\n"
      "for all cores. progress: called with the name of each step before it begins and, if it has a "
      "parameter\n"
      "share, with the name and the share (0 to 1) of the searches for all models that is done.\n\n"
      "Raises as run_case; RefusedError if the views or a model are refused, with all that was computed in\n"
      ".result.");
  module.def(
      "register_sequence", &register_sequence, py::arg("folder"), py::arg("frames"), py::kw_only(),
      py::arg("out") = py::none(), py::arg("resume") = false,
      py::arg("method") = std::string(word(defaults.run.method)), py::arg("max_error_mm") = py::none(),
      py::arg("motion_sigma_mm") = defaults.run.motion_sigma_mm,
      py::arg("search_mm") = defaults.search.shift_mm, py::arg("search_deg") = defaults.search.turn_deg,
      py::arg("threads") = defaults.run.threads, py::arg("history") = py::none(), py::arg("cache") = true,
      py::arg("progress") = py::none(),
      "Follow the models of a case through a sequence of images, as `helicarm register --frames` does.\n\n"
      "frames: \"A-B[:STEP]\" or a range. Returns frames (N numbers), models (for each: name, "
      "world_from_model\n"
      "(N, 4, 4), mm, covariance (N, 6, 6; not a number where the images determine no pose) about centre_mm\n"
      "(N, 3), decision (N words), refused (N reasons "
      "or\n"
      "None)), relative (of the second and further models: name, reference, reference_from_model (N, 4, 4),\n"
      "covariance (N, 6, 6)), warnings and seconds. smoothed (N, 4, 4) and smoothed_covariance (N, 6, 6) of "
      "each\n"
      "model and relative pose: the motion against the first frame by one estimate over all frames, gaps "
      "filled.\n\n"
      "out: folder for registration.csv, bodies.csv, smoothed.csv, relative.csv, sequence.json and "
      "report.html,\n"
      "or None; rows are written as they are computed. resume: go on after the frames of an interrupted run "
      "in\n"
      "`out`. progress: called with the share done, 0 "
      "to 1,\n"
      "after each frame. The others as in register.\n\n"
      "Raises as run_case; RefusedError if a model is refused in some frame, with all poses in .result.");
}

}  // namespace helicarm::python
