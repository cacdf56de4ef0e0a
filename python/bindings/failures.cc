// SPDX-License-Identifier: Apache-2.0
#include "failures.h"

#include "helicarm/core/reason_code.h"

namespace helicarm::python {

py::dict warning_dict(const Warning& warning) {
  py::dict dict;
  dict["code"] = std::string(code(warning.reason));
  dict["message"] = warning.message;
  dict["view"] = warning.view.empty() ? py::object(py::none()) : py::object(py::str(warning.view));
  dict["figures"] = py::cast(warning.figures);
  return dict;
}

std::vector<Warning> warnings_from(const py::list& list) {
  std::vector<Warning> warnings;
  for (const py::handle& each : list) {
    const auto given = each.cast<py::dict>();
    const auto reason = reason_of(given["code"].cast<std::string>());
    if (!reason) throw py::value_error("pickle: of another version of helicarm");
    warnings.push_back({*reason, given["message"].cast<std::string>(),
                        given["view"].is_none() ? std::string() : given["view"].cast<std::string>(),
                        given["figures"].cast<std::map<std::string, double>>()});
  }
  return warnings;
}

void raise(const Failure& failure, const py::object& result) {
  const py::object type = py::module_::import("helicarm.errors")
                              .attr(exit_code(failure.reason) == 2 ? "InputError" : "RefusedError");
  const py::dict given = warning_dict(failure);
  const py::object error = type(given["code"], given["message"], given["view"], given["figures"], result);
  PyErr_SetObject(type.ptr(), error.ptr());
  throw py::error_already_set();
}

void warn(const std::vector<Warning>& warnings) {
  for (const Warning& warning : warnings) {
    const std::string text = std::string(code(warning.reason)) + ": " + warning.message;
    if (PyErr_WarnEx(PyExc_UserWarning, text.c_str(), 1) != 0) throw py::error_already_set();
  }
}

py::object python_from(const Json& json) { return py::module_::import("json").attr("loads")(to_text(json)); }

Json json_from(const py::object& value) {
  // NumPy's arrays and numbers as lists and numbers.
  const py::cpp_function listed([](const py::object& other) {
    if (py::hasattr(other, "tolist")) return py::object(other.attr("tolist")());
    throw py::type_error("dict: holds a " + std::string(py::str(py::type::of(other).attr("__name__"))) +
                         ", which JSON cannot express");
  });
  py::dict dump_options;
  dump_options["default"] = listed;
  std::string text;
  try {
    text = py::module_::import("json").attr("dumps")(value, **dump_options).cast<std::string>();
  } catch (py::error_already_set& error) {
    raise({Reason::bad_json, std::string(py::str(error.value())), {}, {}});
  }
  return value_or_raise(parse_json(text, "dict"));
}

void add_failures(py::module_&) {
  // By value, as pybind11 calls it. NOLINTNEXTLINE(performance-unnecessary-value-param)
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const py::builtin_exception&) {
      throw;
    } catch (const BadInput& bad) {
      try {
        raise(bad.failure());
      } catch (py::error_already_set& error) {
        error.restore();
      }
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::logic_error&) {
      throw;  // misuse: ValueError, IndexError
    } catch (const std::exception& error) {
      const py::object type = py::module_::import("helicarm.errors").attr("HelicarmError");
      PyErr_SetObject(type.ptr(), type("internal", error.what()).ptr());
    }
  });
}

}  // namespace helicarm::python
