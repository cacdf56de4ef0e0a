// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <cstring>

#include <fmt/format.h>

#include "helicarm/core/text.h"
#include "helicarm/exchange/import_formats.h"

namespace helicarm::exchange {
namespace {

using Rows3 = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

constexpr std::string_view table_heading = "view,p11,p12,p13,p14,p21,p22,p23,p24,p31,p32,p33,p34";

[[noreturn]] void refuse_array(const std::string& origin, Reason reason, const std::string& problem) {
  throw BadInput(reason, fmt::format("{}: NumPy array: {}", origin, problem));
}

/// The first field of a line and what stands behind it, from the comma on; in quotes as RFC 4180 has it.
std::pair<std::string, std::string_view> first_field(std::string_view line, const std::string& where) {
  if (!line.starts_with('"')) {
    const std::size_t comma = std::min(line.find(','), line.size());
    return {std::string(line.substr(0, comma)), line.substr(comma)};
  }
  std::string field;
  for (std::size_t at = 1;;) {
    const std::size_t quote = line.find('"', at);
    if (quote == line.npos)
      throw BadInput(Reason::truncated, fmt::format("{}: a quoted view does not end", where));
    field += line.substr(at, quote - at);
    at = quote + 1;
    if (!line.substr(at).starts_with('"')) return {field, line.substr(at)};
    field += line[at++];
  }
}

/// The value of a key in the header's Python dictionary, up to `end`.
std::string dictionary_value(std::string_view header, std::string_view key, char end,
                             const std::string& origin) {
  const std::size_t at = header.find(key);
  const std::size_t colon = at == header.npos ? header.npos : header.find(':', at);
  const std::size_t last = colon == header.npos ? header.npos : header.find(end, colon);
  if (last == header.npos) refuse_array(origin, Reason::truncated, fmt::format("the header has no {}", key));
  return std::string(trimmed(header.substr(colon + 1, last - colon - 1)));
}

/// Of a float of `Stored` in the file's byte order.
template <class Stored, class Bits>
double float_at(const char* bytes, bool big_endian) {
  Bits bits = 0;
  std::memcpy(&bits, bytes, sizeof bits);
  if (big_endian == (std::endian::native == std::endian::little))
    bits = sizeof bits == 8 ? Bits(__builtin_bswap64(bits)) : Bits(__builtin_bswap32(std::uint32_t(bits)));
  return double(std::bit_cast<Stored>(bits));
}

}  // namespace

bool is_matrix_table(std::string_view text) { return text.starts_with(table_heading); }

Cameras parse_matrix_table(std::string_view text, const std::string& origin) {
  Cameras cameras;
  for (std::size_t at = text.find('\n'), line = 2; at != text.npos; ++line) {
    const std::size_t end = std::min(text.find('\n', at + 1), text.size());
    const std::string row(trimmed(text.substr(at + 1, end - at - 1)));
    at = end == text.size() ? text.npos : end;
    if (row.empty()) continue;
    const std::string where = fmt::format("{}: line {}", origin, line);
    const auto [name, numbers] = first_field(row, where);
    if (!numbers.starts_with(',') || cameras.size() == most_cameras)
      throw BadInput(Reason::bad_size,
                     fmt::format("{}: must be a view and 12 numbers, {} lines at most", where, most_cameras));
    cameras.push_back(imported(numbers_in(numbers.substr(1), where), where));
    cameras.back().name = without_control_characters(name);
  }
  if (cameras.empty()) throw BadInput(Reason::truncated, fmt::format("{}: holds no matrix", origin));
  return cameras;
}

bool is_numpy_array(std::string_view bytes) { return bytes.starts_with("\x93NUMPY"); }

Cameras parse_numpy_array(std::string_view bytes, const std::string& origin) {
  constexpr std::size_t fixed = 8;
  const std::size_t length_bytes = bytes.size() > 6 && bytes[6] == 1 ? 2 : 4;
  if (bytes.size() < fixed + length_bytes) refuse_array(origin, Reason::truncated, "the header does not end");
  std::size_t length = 0;
  for (std::size_t i = length_bytes; i-- > 0;)
    length = 256 * length + static_cast<unsigned char>(bytes[fixed + i]);
  const std::size_t start = fixed + length_bytes + length;
  if (start > bytes.size()) refuse_array(origin, Reason::truncated, "the header does not end");
  const std::string_view header = bytes.substr(fixed + length_bytes, length);
  const std::string type = dictionary_value(header, "'descr'", ',', origin);
  const bool is_double = type.ends_with("f8'"), big_endian = type.starts_with("'>");
  if (type.size() != 5 || !(is_double || type.ends_with("f4'")) || !(big_endian || type.starts_with("'<")))
    refuse_array(origin, Reason::unsupported,
                 fmt::format("type {}, must be '<f8', '<f4', '>f8' or '>f4'",
                             without_control_characters(type.substr(0, 40))));
  const bool columns_first = dictionary_value(header, "'fortran_order'", ',', origin) == "True";
  std::string shape = dictionary_value(header, "'shape'", ')', origin);
  std::replace(shape.begin(), shape.end(), '(', ' ');
  auto sides = numbers_in(shape, origin + ": shape");
  if (sides.size() == 2) sides.insert(sides.begin(), 1);
  if (sides.size() != 3 || sides[1] != 3 || sides[2] != 4 || !(sides[0] >= 1 && sides[0] <= most_cameras))
    refuse_array(
        origin, Reason::bad_size,
        fmt::format("shape ({}), must be (3, 4) or (n, 3, 4), n 1 to {}", trimmed(shape), most_cameras));
  const std::size_t count = std::size_t(sides[0]), number_bytes = is_double ? 8 : 4;
  const std::size_t has = bytes.size() - start, needs = 12 * count * number_bytes;
  if (has != needs)
    refuse_array(origin, has < needs ? Reason::truncated : Reason::bad_size,
                 fmt::format("{} bytes of numbers, its shape needs {}", has, needs));
  Cameras cameras;
  for (std::size_t i = 0; i < count; ++i) {
    std::vector<double> numbers;
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 4; ++c) {
        const std::size_t index = columns_first ? i + count * (r + 3 * c) : 12 * i + 4 * r + c;
        const char* at = bytes.data() + start + index * number_bytes;
        numbers.push_back(is_double ? float_at<double, std::uint64_t>(at, big_endian)
                                    : float_at<float, std::uint32_t>(at, big_endian));
        if (!std::isfinite(numbers.back()))
          refuse_array(origin, Reason::not_finite, "a number is not finite");
      }
    cameras.push_back(imported(numbers, fmt::format("{}: matrix {}", origin, i + 1)));
  }
  return cameras;
}

bool is_plastimatch_matrix(std::string_view text) {
  return text.find("\nExtrinsic") != text.npos && text.find("\nIntrinsic") != text.npos;
}

ImportedMatrix parse_plastimatch_matrix(std::string_view text, const std::string& origin) {
  const std::size_t outer = text.find("\nExtrinsic"), inner = text.find("\nIntrinsic");
  constexpr std::size_t word = std::string_view("\nExtrinsic").size();
  if (inner < outer)
    throw BadInput(Reason::bad_value, fmt::format("{}: Intrinsic stands before Extrinsic", origin));
  const auto part = [&](std::string_view numbers, const char* name, std::size_t count) {
    const std::string where = fmt::format("{}: {}", origin, name);
    auto values = numbers_in(numbers, where);
    if (values.size() != count)
      throw BadInput(values.size() < count ? Reason::truncated : Reason::bad_size,
                     fmt::format("{}: {} numbers, must be {}", where, values.size(), count));
    return values;
  };
  // image centre, matrix, source-axis and source-image distance, normal
  const auto head = part(text.substr(0, outer), "before Extrinsic", 2 + 12 + 2 + 3);
  const auto extrinsic = part(text.substr(outer + word, inner - outer - word), "Extrinsic", 16);
  const auto intrinsic = part(text.substr(inner + word), "Intrinsic", 12);
  const Rows3 matrix = Eigen::Map<const Rows3>(head.data() + 2);
  const Rows3 product = Eigen::Map<const Rows3>(intrinsic.data()) *
                        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(extrinsic.data());
  constexpr double rounding = 1e-5;  // plastimatch writes 9 digits
  for (Eigen::Index row = 0; row < 3; ++row)
    if (!((matrix - product).row(row).norm() <= rounding * matrix.row(row).norm()))
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: row {} of the matrix is not that of Intrinsic times Extrinsic", origin, row + 1));
  Rows3 projection = matrix;
  projection.row(0) += head[0] * matrix.row(2);
  projection.row(1) += head[1] * matrix.row(2);
  ImportedMatrix camera = imported({projection.data(), projection.data() + projection.size()}, origin);
  camera.in_mm = true;
  return camera;
}

}  // namespace helicarm::exchange
