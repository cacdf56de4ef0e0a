// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

namespace helicarm::pipeline {

struct ArchivedFile {
  std::string name;  ///< at most 100 bytes, with / between folders
  std::string bytes;
};

/// A gzip-compressed tar archive (POSIX ustar), without times, owners or the machine's name: equal files give
/// equal bytes. Throws std::invalid_argument for a name that is too long or empty.
std::string tar_gz(std::span<const ArchivedFile> files);

}  // namespace helicarm::pipeline
