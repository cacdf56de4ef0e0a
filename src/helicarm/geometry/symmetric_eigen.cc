// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/symmetric_eigen.h"

#include <Eigen/Eigenvalues>

namespace helicarm::geometry {

SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace helicarm::geometry
