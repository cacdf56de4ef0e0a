// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "helicarm/registration/surface_file.h"

namespace helicarm::registration {

/// Type of the numbers of an array in VTK's legacy files; there `vtkIdType` has 32 bits.
struct VtkType {
  std::string_view name;
  std::size_t bytes;
  char kind;  ///< i: signed, u: unsigned, f: floating
};

/// Goes through a legacy file of VTK: words, lines, and arrays as text or in big-endian order. All throw
/// BadInput (truncated, bad_value, bad_size, unsupported) that names what is read.
class VtkCursor {
 public:
  using Values = std::vector<double>;

  VtkCursor(std::string_view bytes, const std::string& origin) : origin_(origin), words_(bytes, origin) {}

  bool is_text() const { return text_; }
  void set_text(bool text) { text_ = text; }
  SurfaceWords& words() { return words_; }

  /// The next word with small letters, at most 100 of them; empty at the end.
  std::string next_small();
  /// The rest of the line without its end.
  std::string_view take_line();
  std::string_view take(std::size_t bytes, std::string_view what);
  /// A whole number from 0 to `limit`.
  std::size_t count(std::string_view what, std::size_t limit);
  const VtkType& type_of(std::string_view what);
  /// `number` values behind the line that states them. What is left of the file bounds the memory.
  Values values(const VtkType& type, std::size_t number, std::string_view what);
  /// To the next empty line.
  void skip_metadata();

  [[noreturn]] void refuse(Reason reason, const std::string& what) const;

 private:
  const std::string& origin_;
  SurfaceWords words_;
  bool text_ = true;
};

}  // namespace helicarm::registration
