// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// A fuzz target is one parser, called as in the program. `NAME_fuzz.cc` defines `run` and `seeds`.
namespace helicarm::fuzz {

/// Parses one input. A crash, a hang, a sanitizer report or a failed check ends the program.
void run(std::string_view bytes);

/// Valid seed inputs, made by the program's own writers.
std::vector<std::string> seeds();

/// Ends the program if the condition on accepted data does not hold.
void check(bool holds, const char* condition);

/// A file with this name and content in a temporary folder of this process.
std::filesystem::path put_file(const std::string& name, std::string_view bytes);
const std::filesystem::path& folder();

/// Takes options that are not content from the front of an input.
class Choices {
 public:
  explicit Choices(std::string_view& bytes) : bytes_(bytes) {}
  /// 0 at the end of the input.
  unsigned byte();
  std::string_view take(std::size_t size);

 private:
  std::string_view& bytes_;
};

}  // namespace helicarm::fuzz
