// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <ranges>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"

namespace helicarm::python {

namespace py = pybind11;

/// helicarm.InputError (exit code 2) or helicarm.RefusedError (3) with code, message, view and figures;
/// `result`: what had been computed until then.
[[noreturn]] void raise(const Failure& failure, const py::object& result = py::none());

template <class T>
T value_or_raise(Expected<T> result) {
  if (!result) raise(result.error());
  if constexpr (!std::is_void_v<T>) return *std::move(result);
}

/// Work that needs no Python object, while other Python threads run.
template <class Work>
auto without_gil(Work&& work) {
  const py::gil_scoped_release release;
  return std::forward<Work>(work)();
}

/// {"code", "message", "view", "figures"} as in result.json.
py::dict warning_dict(const Warning& warning);
template <std::ranges::range Warnings>
py::list warning_list(const Warnings& warnings) {
  py::list list;
  for (const Warning& warning : warnings) list.append(warning_dict(warning));
  return list;
}

/// As Python's own warnings (UserWarning), for what returns nothing that could hold them.
void warn(const std::vector<Warning>& warnings);

/// The inverse, for pickles.
std::vector<Warning> warnings_from(const py::list& list);

/// JSON as Python's own dicts and lists, and back.
py::object python_from(const Json& json);
Json json_from(const py::object& value);

void add_failures(py::module_& module);

}  // namespace helicarm::python
