// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "failures.h"

namespace helicarm::python {

/// The hooks of a long run: `on_stage` calls `progress` (or nothing where None) with the stage's name,
/// `on_share` with the name and the share, in steps of a hundredth, and all end the run on Ctrl-C or where
/// `progress` raises. Python delivers signals to its main thread only: what ends that thread's part of the
/// run ends the others' too.
struct RunHooks {
  std::function<void(std::string_view)> on_stage;
  std::function<void()> on_view;
  std::function<void(double)> on_share;  ///< empty: `progress` takes the name alone
};

/// Whether `progress` has a parameter `share`.
inline bool takes_share(const py::object& progress) {
  if (progress.is_none()) return false;
  try {
    return py::module_::import("inspect").attr("signature")(progress).attr("parameters").contains("share");
  } catch (const py::error_already_set& error) {
    if (error.matches(PyExc_TypeError) || error.matches(PyExc_ValueError)) return false;  // so `inspect` says
    throw;
  }
}

inline RunHooks run_hooks(const py::object& progress) {
  struct Ended {
    std::mutex guard;
    std::exception_ptr reason;
  };
  struct Told {
    std::string stage;
    double percent = -1;
  };
  const auto ended = std::make_shared<Ended>();
  const auto told = std::make_shared<Told>();
  const auto check = [ended] {
    const std::lock_guard lock(ended->guard);
    if (ended->reason) std::rethrow_exception(ended->reason);
    const py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() == 0) return;
    ended->reason = std::make_exception_ptr(py::error_already_set());
    std::rethrow_exception(ended->reason);
  };
  const auto on_share = [check, ended, told, &progress](double share) {
    check();
    const double percent = std::floor(100 * share);
    if (percent == told->percent) return;
    told->percent = percent;
    try {
      const py::gil_scoped_acquire acquire;
      progress(told->stage, py::arg("share") = share);
    } catch (...) {
      const std::lock_guard lock(ended->guard);
      ended->reason = std::current_exception();
      throw;
    }
  };
  return {[check, told, &progress](std::string_view stage) {
            check();
            told->stage = stage;
            if (progress.is_none()) return;
            const py::gil_scoped_acquire acquire;
            progress(told->stage);
          },
          check, takes_share(progress) ? std::function<void(double)>(on_share) : nullptr};
}

}  // namespace helicarm::python
