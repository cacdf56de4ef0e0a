// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "command.h"

namespace helicarm::cli {

struct SolveArguments {
  std::filesystem::path points;  ///< CSV: label,x_mm,y_mm,z_mm,u_px,v_px[,sigma_px]
  std::string method = "ml";     ///< dlt, homogeneous or ml
};

/// A view from known 3-D points and their pixels. No outlier rejection. Without sigmas the covariance is
/// scaled by the residuals.
CommandResult solve_command(const SolveArguments& arguments, Console& console);

}  // namespace helicarm::cli
