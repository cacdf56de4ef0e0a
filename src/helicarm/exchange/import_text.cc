// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/text.h"
#include "helicarm/exchange/import_formats.h"
#include "helicarm/geometry/decomposition.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::exchange {
namespace {

using CameraRows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

double number_from(std::string_view word, const std::string& where) {
  double value = 0;
  const bool plus = word.size() > 1 && word[0] == '+' && word[1] != '-';  // from_chars reads no plus
  const auto [end, error] = std::from_chars(word.data() + plus, word.data() + word.size(), value);
  if (error == std::errc::result_out_of_range || (error == std::errc() && !std::isfinite(value)))
    throw BadInput(Reason::not_finite, fmt::format("{}: \"{}\" is not finite", where, word));
  if (error != std::errc() || end != word.data() + word.size())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: \"{}\" is not a number", where,
                               without_control_characters(std::string(word.substr(0, 40)))));
  return value;
}

}  // namespace

std::string without_byte_order_mark(const std::string& text) {
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
  return text.starts_with(byte_order_mark) ? text.substr(byte_order_mark.size()) : text;
}

std::vector<double> numbers_in(std::string_view text, const std::string& where) {
  constexpr std::string_view separators = " \t\r\n,;[]";
  std::vector<double> numbers;
  for (std::size_t at = text.find_first_not_of(separators); at != std::string_view::npos;) {
    const std::size_t end = std::min(text.find_first_of(separators, at), text.size());
    numbers.push_back(number_from(text.substr(at, end - at), where));
    at = text.find_first_not_of(separators, end);
  }
  return numbers;
}

Eigen::Vector2i image_size_from(const std::vector<double>& numbers, const std::string& where) {
  for (double side : numbers)
    if (numbers.size() != 2 || side < 1 || side > largest_side_px || side != std::floor(side))
      throw BadInput(Reason::bad_value, fmt::format("{}: image size is not two whole numbers in 1 to {}",
                                                    where, largest_side_px));
  if (numbers.empty()) throw BadInput(Reason::truncated, fmt::format("{}: image size is missing", where));
  return {int(numbers[0]), int(numbers[1])};
}

ImportedMatrix imported(const std::vector<double>& numbers, const std::string& where) {
  if (numbers.size() != 12)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} numbers, a 3x4 matrix has 12", where, numbers.size()));
  const geometry::Projection projection =
      Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(numbers.data());
  const auto view = geometry::decompose(projection, Eigen::Vector3d::Zero());
  if (!view) throw BadInput(Reason::bad_value, fmt::format("{}: {}", where, view.error().message));
  return {*view, std::nullopt};
}

geometry::View camera_of(const std::vector<double>& k_numbers, const std::vector<double>& r,
                         const std::vector<double>& t, const std::string& origin) {
  const Eigen::Matrix3d k = Eigen::Map<const CameraRows>(k_numbers.data());
  if (k(1, 0) != 0 || k(2, 0) != 0 || k(2, 1) != 0 || k(2, 2) != 1 || k(0, 0) == 0 || k(1, 1) == 0)
    throw BadInput(
        Reason::bad_value,
        fmt::format("{}: camera matrix: must be upper triangular with a 1 as its last number", origin));
  const geometry::RigidTransform pose{Eigen::Map<const CameraRows>(r.data()),
                                      Eigen::Map<const Eigen::Vector3d>(t.data())};
  value_or_throw(geometry::rigid_transform_from(pose.matrix(), fmt::format("{}: rotation", origin)));
  return {{k(0, 0), k(1, 1), k(0, 2), k(1, 2), k(0, 1)}, pose};
}

}  // namespace helicarm::exchange
