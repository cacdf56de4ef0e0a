// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/sweep.h"

#include <limits>
#include <memory>

#include "arrays.h"
#include "module.h"
#include "run_sweep.h"

namespace helicarm::python {
namespace {

constexpr double absent = std::numeric_limits<double>::quiet_NaN();

using Ends = std::array<std::array<double, 3>, 2>;

sweep::Sweep swept(const std::filesystem::path& folder, const std::optional<std::string>& path,
                   const std::optional<std::string>& check, const std::optional<Ends>& wire,
                   const std::optional<std::filesystem::path>& against,
                   const std::optional<std::filesystem::path>& history, unsigned threads,
                   const py::object& progress) {
  const auto read = [&] {
    return guarded([&] {
      auto the_case = value_or_throw(sweep::read_sweep_case(folder));
      if (history) sweep::take_maps(the_case, value_or_throw(calibration::read_history(*history)));
      return the_case;
    });
  };
  return run_sweep(read, path, check_options(check, wire, against, threads), threads, progress);
}

/// (n, rows, columns), NaN where a frame is refused.
template <class Value>
py::array frames_array(const sweep::Sweep& sweep, py::ssize_t rows, py::ssize_t columns, Value value) {
  py::array_t<double> array({py::ssize_t(sweep.frames.size()), rows, columns});
  double* at = array.mutable_data();
  for (const sweep::SweepFrame& frame : sweep.frames) {
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> block(at, rows,
                                                                                             columns);
    if (frame.best)
      block = value(*frame.best);
    else
      block.setConstant(absent);
    at += rows * columns;
  }
  return read_only(array);
}

}  // namespace

void add_sweep(py::module_& module) {
  using calibration::CalibratedView;
  py::class_<sweep::Sweep>(module, "Sweep",
                           "The answer of sweep; to_dict() is sweep.json. n is the number of images.")
      .def_property_readonly("status", [](const sweep::Sweep& s) { return s.failure ? "refused" : "ok"; })
      .def_property_readonly("warnings", [](const sweep::Sweep& s) { return warning_list(s.warnings); })
      .def_property_readonly(
          "frames",
          [](const sweep::Sweep& s) {
            std::vector<int> numbers;
            for (const sweep::SweepFrame& frame : s.frames) numbers.push_back(frame.number);
            return numbers;
          },
          "Number of each image.")
      .def_property_readonly(
          "accepted",
          [](const sweep::Sweep& s) {
            std::vector<bool> accepted;
            for (const sweep::SweepFrame& frame : s.frames) accepted.push_back(frame.best.has_value());
            return accepted;
          },
          "Whether each image is accepted (decision accept or warn).")
      .def_property_readonly(
          "projections",
          [](const sweep::Sweep& s) {
            return frames_array(s, 3, 4, [](const CalibratedView& view) { return view.view.projection(); });
          },
          "(n, 3, 4): calibrator, mm, to rectified pixels; NaN where an image is refused.")
      .def_property_readonly(
          "covariances",
          [](const sweep::Sweep& s) {
            return frames_array(s, 11, 11, [](const CalibratedView& view) { return view.covariance; });
          },
          "(n, 11, 11): of each image's parameters, in the order of sweep.json.")
      .def_property_readonly(
          "sources",
          [](const sweep::Sweep& s) {
            return frames_array(s, 1, 3,
                                [](const CalibratedView& view) -> Eigen::RowVector3d {
                                  return view.view.source_in_world().transpose();
                                })
                .attr("reshape")(s.frames.size(), 3);
          },
          "(n, 3): mm, calibrator frame.")
      .def_property_readonly(
          "source_covariances",
          [](const sweep::Sweep& s) {
            return frames_array(
                s, 3, 3, [](const CalibratedView& view) { return calibration::source_covariance(view); });
          },
          "(n, 3, 3): mm^2.")
      .def_property_readonly(
          "check", [](const sweep::Sweep& s) { return python_from(sweep::to_json(s)["check"]); },
          "Widths in a reconstruction, as in sweep.json; None without it.")
      .def(
          "to_dict", [](const sweep::Sweep& s) { return python_from(sweep::to_json(s)); },
          "The content of sweep.json.")
      .def(
          "write",
          [](const sweep::Sweep& s, const std::filesystem::path& folder) {
            value_or_raise(without_gil([&] {
              sweep::forget_sweep(folder);
              return sweep::write_sweep(s, folder);
            }));
          },
          py::arg("folder"), "sweep.json, geometry/ and report.html. Raises InputError: cannot_write.")
      .def("__repr__", [](const sweep::Sweep& s) {
        if (s.failure) return fmt::format("<Sweep: refused, {}>", code(s.failure->reason));
        return fmt::format(
            "<Sweep: {} of {} images accepted>",
            std::ranges::count_if(s.frames, [](const auto& frame) { return frame.best.has_value(); }),
            s.frames.size());
      });
  const sweep::SweepOptions usual;
  module.def(
      "sweep", &swept, py::arg("folder"), py::kw_only(), py::arg("path") = py::none(),
      py::arg("check") = py::none(), py::arg("wire") = py::none(), py::arg("against") = py::none(),
      py::arg("history") = py::none(), py::arg("threads") = usual.threads, py::arg("progress") = py::none(),
      R"(Calibrates every image of a rotation or tomosynthesis and all of them on one path, as `helicarm sweep` does.

folder: holds case.json, whose view has "frames". path: "smooth", "free" or None (smooth for 16 or more images of one
run). check: "FDK" reconstructs balls and a wire with plastimatch, with these cameras and with the ideal circle: .check;
where it is not possible a warning says why. wire: its two ends, mm, calibrator frame. against: file of another program's
cameras, compared too. history: a C-arm's record, whose maps rectify images without a plate by their angles. progress: called with the share of the images that are done; an exception from it ends the run, and Ctrl-C does.
Releases the GIL. Returns a Sweep.
Raises InputError; RefusedError with .result if the run as a whole is refused.)");
}

}  // namespace helicarm::python
