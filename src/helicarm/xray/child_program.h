// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include <sys/types.h>

#include "helicarm/core/failure.h"

namespace helicarm::xray {

/// A program that is looked for in PATH and whose output is read as it comes. It has a process group of its
/// own, so that Ctrl-C does not reach it, no input, and at most 4 GiB of memory where the system limits it;
/// it is killed on destruction.
class ChildProgram {
 public:
  /// Throws BadInput: missing_file where there is no such program.
  explicit ChildProgram(const std::vector<std::string>& words);
  ~ChildProgram();
  ChildProgram(const ChildProgram&) = delete;
  ChildProgram& operator=(const ChildProgram&) = delete;

  /// Fills `into`; returns fewer bytes only at the end of the output. Throws BadInput (bad_value) where no
  /// byte comes for a minute.
  std::size_t read(std::span<char> into);
  /// After the end of the output: whether it ended with 0.
  bool ended_well();
  /// The first line that it wrote as an error.
  std::string first_error() const;

 private:
  bool take(int& pipe, std::span<char> into, std::size_t& got);

  std::string name_;
  pid_t child_ = -1;
  int output_ = -1, errors_ = -1;
  std::string messages_;  ///< at most a few kB
};

}  // namespace helicarm::xray
