// SPDX-License-Identifier: Apache-2.0
#include "module.h"

#include "helicarm/core/program_version.h"

/// " (5da20f9512)", or empty; written at each build by cmake/commit.cmake.
extern const char* const commit_in_brackets;

namespace helicarm::python {

PYBIND11_MODULE(_helicarm, module) {
  module.doc() = "Compiled part of helicarm; import helicarm instead.";
  module.attr("__version__") = HELICARM_VERSION;
  program_commit() = commit_in_brackets;
  const std::string commit = program_commit();
  module.attr("__commit__") = commit.empty() ? std::string() : commit.substr(2, commit.size() - 3);
  add_failures(module);
  add_images(module);
  add_phantom(module);
  add_rectification(module);
  add_calibration(module);
  add_measures(module);
  add_cases(module);
  add_registration(module);
  add_volume(module);
  add_surface(module);
  add_camera(module);
  add_c_arm(module);
  add_sweep(module);
  add_track(module);
  add_migration(module);
  add_segmentation(module);
  add_phantom_calibration(module);
  add_in_memory(module);
  add_session(module);
  add_files(module);
}

}  // namespace helicarm::python
