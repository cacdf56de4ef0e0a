// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace helicarm {

/// Commit of the running program, " (a1b2c3d4e5)" or empty: the program states it when it begins, as the
/// library is not compiled anew for a commit.
inline std::string& program_commit() {
  static std::string commit;
  return commit;
}

/// Version and commit of the running program.
inline std::string program_version() { return HELICARM_VERSION + program_commit(); }

}  // namespace helicarm
