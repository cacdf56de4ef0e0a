// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "failures.h"

namespace helicarm::python {

/// The hooks of a long run: `on_stage` calls `progress` (or nothing where None), and both end the run on
/// Ctrl-C or where `progress` raises. Python delivers signals to its main thread only: what ends that
/// thread's part of the run ends the others' too.
struct RunHooks {
  std::function<void(std::string_view)> on_stage;
  std::function<void()> on_view;
};

inline RunHooks run_hooks(const py::object& progress) {
  struct Ended {
    std::mutex guard;
    std::exception_ptr reason;
  };
  const auto ended = std::make_shared<Ended>();
  const auto check = [ended] {
    const std::lock_guard lock(ended->guard);
    if (ended->reason) std::rethrow_exception(ended->reason);
    const py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() == 0) return;
    ended->reason = std::make_exception_ptr(py::error_already_set());
    std::rethrow_exception(ended->reason);
  };
  return {[check, &progress](std::string_view stage) {
            check();
            if (progress.is_none()) return;
            const py::gil_scoped_acquire acquire;
            progress(std::string(stage));
          },
          check};
}

}  // namespace helicarm::python
