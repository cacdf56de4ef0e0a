// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/nifti_header.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include "helicarm/core/failure.h"
#include "helicarm/volume/voxels.h"

namespace helicarm::volume {
namespace {

using namespace std::literals;

constexpr std::size_t magic_at_1 = 344, magic_at_2 = 4, first_header = 348, second_header = 540;

bool has_magic(std::string_view bytes, std::size_t at, std::string_view version) {
  return bytes.size() >= at + 4 && (bytes.substr(at, 4) == "n+"s.append(version).append(1, '\0') ||
                                    bytes.substr(at, 4) == "ni"s.append(version).append(1, '\0'));
}

bool is_second(std::string_view bytes) { return has_magic(bytes, magic_at_2, "2"); }
bool is_first(std::string_view bytes) { return has_magic(bytes, magic_at_1, "1"); }

/// Analyze's header has the size of NIfTI-1's, and no magic.
bool is_analyze(std::string_view bytes) {
  return bytes.size() >= first_header &&
         (bytes.starts_with("\x5c\1\0\0"sv) || bytes.starts_with("\0\0\1\x5c"sv));
}

std::size_t size_of_type(NiftiField::Type type) {
  using Type = NiftiField::Type;
  switch (type) {
    case Type::uint8:
      return 1;
    case Type::int16:
      return 2;
    case Type::int32:
    case Type::float32:
      return 4;
    default:
      return 8;
  }
}

std::string unpacked_start(std::string_view file, const std::string& origin) {
  if (!file.starts_with("\x1f\x8b")) return std::string(file.substr(0, second_header));
  const std::string start = inflate(file, first_header, origin);
  return is_second(start) ? inflate(file, second_header, origin) : start;
}

}  // namespace

bool is_nifti_header(std::string_view bytes) {
  return is_second(bytes) || is_first(bytes) || is_analyze(bytes);
}

NiftiHeader::NiftiHeader(std::string_view file, std::string origin)
    : bytes_(unpacked_start(file, origin)), origin_(std::move(origin)), second_(is_second(bytes_)) {
  if (bytes_.size() < size())
    throw BadInput(Reason::truncated,
                   fmt::format("{}: {} bytes, the header has {}", origin_, bytes_.size(), size()));
  if (!second_ && !is_first(bytes_))
    throw BadInput(Reason::not_an_image,
                   is_analyze(bytes_)
                       ? origin_ +
                             ": is an ANALYZE 7.5 header, which does not state the patient's orientation: "
                             "left and right cannot be distinguished; convert the volume to NIfTI with an "
                             "sform or qform"
                       : origin_ + ": not a NIfTI file");
  if (second_ && bytes_.substr(magic_at_2 + 4, 4) != "\r\n\x1a\n")
    throw BadInput(Reason::bad_value, origin_ +
                                          ": magic does not end with 0D 0A 1A 0A: the file was damaged by "
                                          "a transfer as text; copy it again");
  pair_ = bytes_[(second_ ? magic_at_2 : magic_at_1) + 1] == 'i';
  const auto stated = [&] { return whole(nifti::sizeof_hdr); };
  swap_ = stated() != std::int64_t(size());
  if (swap_ && stated() != std::int64_t(size())) {
    swap_ = false;
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: sizeof_hdr is {}, must be {}", origin_, stated(), size()));
  }
}

template <class T>
T NiftiHeader::stored(std::size_t offset) const {
  char word[sizeof(T)];
  std::memcpy(word, bytes_.data() + offset, sizeof word);
  if (swap_) std::reverse(word, word + sizeof word);
  T value;
  std::memcpy(&value, word, sizeof word);
  return value;
}

template <class Number>
Number NiftiHeader::value(const NiftiField& field, std::size_t index) const {
  using Type = NiftiField::Type;
  const auto& [start, type] = second_ ? field.in_2 : field.in_1;
  const std::size_t offset = start + index * size_of_type(type);
  switch (type) {
    case Type::uint8:
      return static_cast<Number>(stored<std::uint8_t>(offset));
    case Type::int16:
      return static_cast<Number>(stored<std::int16_t>(offset));
    case Type::int32:
      return static_cast<Number>(stored<std::int32_t>(offset));
    case Type::int64:
      return static_cast<Number>(stored<std::int64_t>(offset));
    case Type::float32:
      return static_cast<Number>(stored<float>(offset));
    case Type::float64:
      return static_cast<Number>(stored<double>(offset));
  }
  return {};
}

std::int64_t NiftiHeader::whole(const NiftiField& field, std::size_t index) const {
  return value<std::int64_t>(field, index);
}

double NiftiHeader::number(const NiftiField& field, std::size_t index) const {
  return value<double>(field, index);
}

double NiftiHeader::finite(const NiftiField& field, std::size_t index) const {
  const double found = number(field, index);
  if (!std::isfinite(found))
    throw BadInput(Reason::not_finite, fmt::format("{}: {}{} is {}", origin_, field.name,
                                                   field.is_list ? fmt::format("[{}]", index) : "", found));
  return found;
}

}  // namespace helicarm::volume
