// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// A fuzz target is one parser, called as the program calls it. `NAME_fuzz.cc` defines `run` and `seeds`.
namespace helicarm::fuzz {

/// Parses one input. A crash, a hang, a sanitizer's report or a broken promise ends the program.
void run(std::string_view bytes);

/// Sound inputs to start from, made by the program's own writers.
std::vector<std::string> seeds();

/// Ends the program unless the promise about what was accepted holds.
void check(bool holds, const char* promise);

/// A file of this name and content in a temporary folder of this process.
std::filesystem::path put_file(const std::string& name, std::string_view bytes);
const std::filesystem::path& folder();

/// Takes choices that are not content off the front of an input.
class Choices {
 public:
  explicit Choices(std::string_view& bytes) : bytes_(bytes) {}
  /// 0 where the input is used up.
  unsigned byte();
  std::string_view take(std::size_t size);

 private:
  std::string_view& bytes_;
};

}  // namespace helicarm::fuzz
