// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

namespace helicarm::cli {

/// Lines of bounded length from a descriptor such as a terminal or a pipe.
class LineInput {
 public:
  static constexpr std::size_t longest = 1000;

  explicit LineInput(int descriptor) : descriptor_(descriptor) {}

  /// The next line without its end; empty if none arrives within this time. Throws BadInput: `interrupted` at
  /// the end of the input, `bad_size` for a line over 1000 bytes.
  std::optional<std::string> next(int patience_ms);

  /// Before a question: what was typed at a terminal before it is no answer. Lines of a pipe or a file stay.
  void discard();

 private:
  int descriptor_;
  std::string held_;
  bool ended_ = false;
};

}  // namespace helicarm::cli
