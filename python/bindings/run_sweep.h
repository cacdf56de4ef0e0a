// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "helicarm/sweep/sweep.h"
#include "module.h"
#include "signals.h"

namespace helicarm::python {

/// `sweep::run_sweep` without the interpreter's lock, of the case that `read` gives. Raises where it is
/// refused, with the sweep as the exception's result.
template <class Read>
sweep::Sweep run_sweep(const Read& read, const std::optional<std::string>& path, unsigned threads,
                       const py::object& progress) {
  sweep::SweepOptions options;
  options.threads = threads;
  if (path) options.path = value_or_raise(sweep::path_kind(*path));
  const py::object nothing = py::none();
  const RunHooks hooks = run_hooks(nothing);
  sweep::Sweep result = value_or_raise(without_gil([&] {
    return read().and_then([&](const sweep::SweepCase& the_case) {
      return sweep::run_sweep(the_case, options, [&](double share) {
        hooks.on_view();
        if (progress.is_none()) return;
        const py::gil_scoped_acquire acquire;
        progress(share);
      });
    });
  }));
  if (result.failure) raise(*result.failure, py::cast(result));
  return result;
}

}  // namespace helicarm::python
