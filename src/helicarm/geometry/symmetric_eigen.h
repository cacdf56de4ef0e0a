// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace helicarm::geometry {

/// Eigenvalues, ascending, and unit eigenvectors, the columns.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};

/// Of a symmetric matrix, of which the lower triangle is read. Compiled once for all sizes: Eigen's solver
/// takes seconds of each unit that names it.
SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& matrix);

}  // namespace helicarm::geometry
