// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <pybind11/numpy.h>

#include "failures.h"
#include "helicarm/image/image.h"

namespace helicarm::python {

namespace py = pybind11;
using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

inline std::string shape_of(const py::array& array) {
  std::string text = "(";
  for (py::ssize_t i = 0; i < array.ndim(); ++i)
    text += (i ? ", " : "") + std::to_string(array.shape(i)) + (array.ndim() == 1 ? "," : "");
  return text + ")";
}

[[noreturn]] inline void raise_not_real(const py::array& array, const std::string& name) {
  raise({Reason::bad_value,
         fmt::format("{}: its elements are {}, not real numbers", name,
                     std::string(py::str(py::object(array.dtype())))),
         {},
         {}});
}

/// What NumPy's conversion to a number type would change without a word: it drops a mask and an imaginary
/// part, and reads numbers in texts, also of what lists hold.
inline void check_plain(const py::handle& given, const std::string& name) {
  if (py::isinstance<py::list>(given) || py::isinstance<py::tuple>(given)) {
    for (const py::handle element : given) {
      if (py::isinstance<py::str>(element) || py::isinstance<py::bytes>(element))
        raise({Reason::bad_value, name + ": its elements are texts, not real numbers", {}, {}});
      check_plain(element, name);
    }
    return;
  }
  if (!py::isinstance<py::array>(given)) return;
  const auto array = py::reinterpret_borrow<py::array>(given);
  const char kind = array.dtype().kind();
  if (std::string_view("biufO").find(kind) == std::string_view::npos) raise_not_real(array, name);
  if (kind == 'O') check_plain(array.attr("ravel")().attr("tolist")(), name);
  if (Py_TYPE(array.ptr()) == py::detail::npy_api::get().PyArray_Type_) return;
  const auto masked = py::module_::import("numpy.ma");
  if (!masked.attr("is_masked")(array).cast<bool>()) return;
  const auto count = masked.attr("count_masked")(array).cast<py::ssize_t>();
  raise({Reason::bad_value,
         fmt::format(
             "{}: {} of {} elements are masked, and a mask is not kept: leave them out, or fill them by "
             "numpy.ma.filled",
             name, count, array.size()),
         {},
         {{"masked", double(count)}}});
}

/// The array of what NumPy makes one of, such as lists, with elements that are real numbers.
inline py::array plain_array(const py::object& given, const std::string& name) {
  check_plain(given, name);
  const py::array array = py::array::ensure(given);
  if (!array) raise({Reason::bad_value, name + ": is no array of numbers", {}, {}});
  if (std::string_view("biuf").find(array.dtype().kind()) == std::string_view::npos)
    raise_not_real(array, name);
  return array;
}

inline void check_finite(const Doubles& array, const std::string& name, const std::string& view = {}) {
  for (py::ssize_t i = 0; i < array.size(); ++i)
    if (!std::isfinite(array.data()[i]))
      raise({Reason::not_finite,
             fmt::format("{}: element {} is not a finite number", name, i),
             view,
             {{"element", double(i)}}});
}

/// Rows of an N x K array; a plain vector of K numbers is one row. `finite` false: NaN is accepted.
template <int K>
std::vector<Eigen::Vector<double, K>> rows_of(const Doubles& array, const std::string& name,
                                              const std::string& view = {}, bool finite = true) {
  const bool one = array.ndim() == 1 && array.shape(0) == K;
  if (!one && !(array.ndim() == 2 && array.shape(1) == K))
    raise(
        {Reason::bad_value, fmt::format("{}: shape {} is not (N, {})", name, shape_of(array), K), view, {}});
  if (finite) check_finite(array, name, view);
  std::vector<Eigen::Vector<double, K>> rows(std::size_t(array.size() / K));
  for (std::size_t i = 0; i < rows.size(); ++i)
    rows[i] = Eigen::Map<const Eigen::Vector<double, K>>(array.data() + K * py::ssize_t(i));
  return rows;
}

/// N x K, or (K,) where `one` row was asked for.
template <int K>
py::array rows_array(const std::vector<Eigen::Vector<double, K>>& rows, bool one = false) {
  auto array = one ? py::array_t<double>(py::ssize_t{K})
                   : py::array_t<double>({py::ssize_t(rows.size()), py::ssize_t{K}});
  for (std::size_t i = 0; i < rows.size(); ++i)
    std::memcpy(array.mutable_data() + K * py::ssize_t(i), rows[i].data(), K * sizeof(double));
  return array;
}

/// K numbers: a row, or a column as OpenCV's vectors are.
template <int K>
Eigen::Vector<double, K> row_of(const Doubles& array, const std::string& name, const std::string& view = {}) {
  if (array.size() != K)
    raise({Reason::bad_value, fmt::format("{}: shape {} is not ({},)", name, shape_of(array), K), view, {}});
  check_finite(array, name, view);
  return Eigen::Map<const Eigen::Vector<double, K>>(array.data());
}

/// An attribute's array: changing its elements would not change the object.
inline py::array read_only(py::array array) {
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

/// Row major, as NumPy's own.
inline py::array matrix_array(const Eigen::MatrixXd& matrix) {
  py::array_t<double> array({matrix.rows(), matrix.cols()});
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      array.mutable_data(), matrix.rows(), matrix.cols()) = matrix;
  return array;
}

template <int K>
py::object vector_array(const std::optional<Eigen::Vector<double, K>>& vector) {
  if (!vector) return py::none();
  return read_only(rows_array<K>({*vector}, true));
}

inline Eigen::MatrixXd matrix_of(const Doubles& array, py::ssize_t rows, py::ssize_t columns,
                                 const std::string& name, const std::string& view = {}) {
  if (array.ndim() != 2 || array.shape(0) != rows || array.shape(1) != columns)
    raise({Reason::bad_value,
           fmt::format("{}: shape {} is not ({}, {})", name, shape_of(array), rows, columns),
           view,
           {}});
  check_finite(array, name, view);
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      array.data(), rows, columns);
}

/// (height, width), rows from top to bottom. Without a copy: `owner` keeps the pixels alive, which are read
/// only.
template <class T>
py::array view_of(const image::Image<T>& image, const py::handle& owner) {
  py::array_t<T> array({py::ssize_t(image.height()), py::ssize_t(image.width())}, image.pixels().data(),
                       owner);
  return read_only(array);
}

/// The same for an image that nothing else holds.
template <class T>
py::array moved_to_array(image::Image<T> image) {
  auto* held = new image::Image<T>(std::move(image));
  const py::capsule owner(held, [](void* memory) { delete static_cast<image::Image<T>*>(memory); });
  return py::array_t<T>({py::ssize_t(held->height()), py::ssize_t(held->width())}, held->pixels().data(),
                        owner);
}

}  // namespace helicarm::python

namespace pybind11::detail {

template <>
class type_caster<helicarm::python::Doubles> : public pyobject_caster<helicarm::python::Doubles> {
 public:
  bool load(handle given, bool convert) {
    helicarm::python::check_plain(given, name_of(given));
    return pyobject_caster<helicarm::python::Doubles>::load(given, convert);
  }

 private:
  static std::string name_of(handle given) {
    if (!isinstance<array>(given)) return "a list";
    return "an array of shape " + helicarm::python::shape_of(reinterpret_borrow<array>(given));
  }
};

}  // namespace pybind11::detail
