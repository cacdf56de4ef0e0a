// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <utility>

#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/exchange/run_geometry.h"
#include "helicarm/sweep/sweep.h"

namespace helicarm::sweep {
namespace {

exchange::RunGeometry geometry_of(const Sweep& sweep) {
  exchange::RunGeometry run{{}, sweep.detector.image_size, sweep.pixel_known ? sweep.detector.pixel_mm : 1};
  for (const SweepFrame& frame : sweep.frames)
    if (frame.best) run.images.push_back({frame.view, frame.best->view});
  return run;
}

using Writer = Expected<std::string> (*)(const exchange::RunGeometry&);

/// A writer of text that cannot fail.
template <std::string (*write)(const exchange::RunGeometry&)>
Expected<std::string> always(const exchange::RunGeometry& run) {
  return write(run);
}

constexpr std::array<std::pair<const char*, Writer>, 5> geometry_files{
    {{"rtk.xml", exchange::rtk_geometry},
     {"astra.txt", always<exchange::astra_vectors>},
     {"matrices.ompl", always<exchange::ompl_matrices>},
     {"matrices.csv", always<exchange::matrices_csv>},
     {"matrices.npy", always<exchange::matrices_npy>}}};

}  // namespace

void forget_sweep(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& [name, writer] : geometry_files) names.emplace_back(name);
  forget_files(folder / "geometry", names);
  std::error_code ignored;
  if (std::filesystem::is_directory(folder / "geometry", ignored) &&
      std::filesystem::is_empty(folder / "geometry", ignored))
    std::filesystem::remove(folder / "geometry", ignored);
  forget_files(folder, std::vector<std::string>{"report.html", "sweep.json"});
}

Expected<void> write_sweep(const Sweep& sweep, const std::filesystem::path& folder) {
  return guarded([&] {
    if (!sweep.failure) {
      const exchange::RunGeometry run = geometry_of(sweep);
      for (const auto& [name, writer] : geometry_files)
        value_or_throw(write_file(folder / "geometry" / name, value_or_throw(writer(run))));
    }
    value_or_throw(write_file(folder / "report.html", sweep_report(sweep)));
    value_or_throw(write_file(folder / "sweep.json", to_text(to_json(sweep)) + "\n"));
  });
}

}  // namespace helicarm::sweep
