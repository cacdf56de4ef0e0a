// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/import_matrix.h"
#include "target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) {
  const auto matrix = geometry::import_matrix(put_file("input.txt", bytes), 10);
  if (!matrix) return;
  check(matrix->view.camera_from_world.matrix().allFinite(), "the camera's position is finite");
  check(std::isfinite(matrix->view.intrinsics.fx) && std::isfinite(matrix->view.intrinsics.fy),
        "focal lengths are finite");
  const Eigen::Matrix3d& rotation = matrix->view.camera_from_world.rotation;
  check((rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).norm() < 0.01,
        "the rotation is orthonormal");
}

std::vector<std::string> seeds() {
  return {
      "image size\n1024,768\n\ncamera "
      "matrix\n4000,0,512\n0,4000,384\n0,0,1\n\nrotation\n1,0,0\n0,1,0\n0,0,1\n\n"
      "translation\n3\n-5\n700\n",
      "4000 0 512 1\n0 4000 384 2\n0 0 1 700\n", "[[4000,0,512,1],[0,4000,384,2],[0,0,1,700]]",
      R"({"projection": [[4000,0,512,1],[0,4000,384,2],[0,0,1,700]], "image_size": [1024, 768]})",
      "NRRD0004\nsizes: 1024 768\nProjection Matrix:=[[4000,0,512,1],[0,4000,384,2],[0,0,1,700]]\n\n"};
}

}  // namespace helicarm::fuzz
