// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/tre_volume.h"

#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/localization/locate.h"

namespace helicarm::localization {

TreVolume predict_tre(const calibration::Calibration& calibration, const Eigen::Vector3d& centre,
                      double half_mm, double step_mm, double sigma_px, unsigned threads,
                      double motion_sigma_mm) {
  const int arm = int(std::floor(half_mm / step_mm + 1e-9));
  TreVolume volume{centre - Eigen::Vector3d::Constant(arm * step_mm), step_mm, 2 * arm + 1, {}};
  const auto side = std::size_t(volume.side);
  volume.rms_mm.resize(side * side * side);
  parallel_for(side, threads, [&](std::size_t k) {
    for (std::size_t j = 0; j < side; ++j)
      for (std::size_t i = 0; i < side; ++i) {
        const auto covariance =
            predict_covariance(volume.place(int(i), int(j), int(k)), sigma_px, calibration, motion_sigma_mm);
        volume.rms_mm[(k * side + j) * side + i] =
            covariance ? std::sqrt(covariance->trace()) : std::numeric_limits<double>::quiet_NaN();
      }
  });
  return volume;
}

std::string to_csv(const TreVolume& volume) {
  std::string text = "x_mm,y_mm,z_mm,tre_mm\n";
  for (int k = 0; k < volume.side; ++k)
    for (int j = 0; j < volume.side; ++j)
      for (int i = 0; i < volume.side; ++i) {
        const Eigen::Vector3d p = volume.place(i, j, k);
        fmt::format_to(std::back_inserter(text), "{},{},{},", p.x(), p.y(), p.z());
        if (std::isfinite(volume.at(i, j, k)))
          fmt::format_to(std::back_inserter(text), "{}", volume.at(i, j, k));
        text += '\n';
      }
  return text;
}

std::string to_vtk(const TreVolume& volume) {
  std::string text = fmt::format(
      "# vtk DataFile Version 3.0\nPredicted TRE, mm rms\nASCII\nDATASET STRUCTURED_POINTS\n"
      "DIMENSIONS {0} {0} {0}\nORIGIN {1} {2} {3}\nSPACING {4} {4} {4}\nPOINT_DATA {5}\n"
      "SCALARS tre_mm double 1\nLOOKUP_TABLE default\n",
      volume.side, volume.first.x(), volume.first.y(), volume.first.z(), volume.step_mm,
      volume.rms_mm.size());
  for (const double rms : volume.rms_mm) fmt::format_to(std::back_inserter(text), "{}\n", rms);
  return text;
}

}  // namespace helicarm::localization
