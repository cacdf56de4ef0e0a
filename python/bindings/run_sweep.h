// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "helicarm/sweep/sweep.h"
#include "module.h"
#include "signals.h"

namespace helicarm::python {

/// What a sweep reconstructs; nothing without `check`.
inline std::optional<sweep::CheckOptions> check_options(
    const std::optional<std::string>& check, const std::optional<std::array<std::array<double, 3>, 2>>& wire,
    const std::optional<std::filesystem::path>& against, unsigned threads) {
  if (!check) {
    if (wire || against) raise({Reason::usage, "sweep: wire and against require check=\"FDK\"", {}, {}});
    return {};
  }
  if (*check != "FDK")
    raise({Reason::bad_value, fmt::format("check: \"{}\" is not \"FDK\"", *check), {}, {}});
  sweep::CheckOptions options;
  options.threads = threads;
  if (wire)
    options.wire = value_or_raise(sweep::wire_from(
        fmt::format("{:.17g},{:.17g},{:.17g};{:.17g},{:.17g},{:.17g}", (*wire)[0][0], (*wire)[0][1],
                    (*wire)[0][2], (*wire)[1][0], (*wire)[1][1], (*wire)[1][2])));
  if (against) options.against = value_or_raise(exchange::import_cameras(*against));
  return options;
}

/// `sweep::run_sweep` without the interpreter's lock, of the case that `read` gives, and the check that is
/// asked for. Raises where it is refused, with the sweep as the exception's result.
template <class Read>
sweep::Sweep run_sweep(const Read& read, const std::optional<std::string>& path,
                       const std::optional<sweep::CheckOptions>& check, unsigned threads,
                       const py::object& progress) {
  sweep::SweepOptions options;
  options.threads = threads;
  if (path) options.path = value_or_raise(sweep::path_kind(*path));
  const py::object nothing = py::none();
  const RunHooks hooks = run_hooks(nothing);
  sweep::Sweep result = value_or_raise(without_gil([&] {
    return read().and_then([&](const sweep::SweepCase& the_case) {
      const auto tell = [&](double share) {
        hooks.on_view();
        if (progress.is_none()) return;
        const py::gil_scoped_acquire acquire;
        progress(share);
      };
      return sweep::run_sweep(the_case, options, tell).and_then([&](sweep::Sweep swept) {
        return guarded([&] {
          if (check) value_or_throw(sweep::add_check(swept, the_case, *check));
          return std::move(swept);
        });
      });
    });
  }));
  if (result.failure) raise(*result.failure, py::cast(result));
  return result;
}

}  // namespace helicarm::python
