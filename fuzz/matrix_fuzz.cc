// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/exchange/itk_transform.h"
#include "target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) {
  const auto file = put_file("input.txt", bytes);
  if (const auto transform = exchange::read_itk_transform(file); transform && *transform)
    check((*transform)->matrix().allFinite(), "the transform is finite");
  exchange::ImportOptions options{.mm_per_unit = 10, .column = 1, .image_size = Eigen::Vector2i(1024, 768)};
  options.pixel_mm = {0.4, 0.4};
  auto matrix = exchange::import_matrix(file, options);
  if (!matrix) {  // a format that is in mm
    options.mm_per_unit.reset();
    matrix = exchange::import_matrix(file, options);
  }
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
      "4000 0 512 1\n0 4000 384 2\n0 0 1 700\n",
      "[[4000,0,512,1],[0,4000,384,2],[0,0,1,700]]",
      R"({"projection": [[4000,0,512,1],[0,4000,384,2],[0,0,1,700]], "image_size": [1024, 768]})",
      "#Insight Transform File V1.0\nTransform: Euler3DTransform_double_3_3\nParameters: 0.1 0.2 0.3 4 5 6\n"
      "FixedParameters: 7 8 9 1\n",
      "<RTKThreeDCircularGeometry version=\"3\"><SourceToIsocenterDistance>1000</SourceToIsocenterDistance>"
      "<Projection><SourceToDetectorDistance>1500</SourceToDetectorDistance></Projection>"
      "</RTKThreeDCircularGeometry>",
      "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   data: [ 4000., 0., 512., 0.,\n      "
      "4000., "
      "384., 0., 0., 1. ]\nrvec: [ 0.1, 0.2, 0.3 ]\ntvec: [ 3., -5., 700. ]\n",
      "# ASTRA cone_vec\n0 0 -700 0 0 300 0.4 0 0 0 0.4 0\n",
      "[4000 0 512 1; 0 4000 384 2; 0 0 1 700]\n",
      "view,p11,p12,p13,p14,p21,p22,p23,p24,p31,p32,p33,p34\nA/1,4000,0,512,1,0,4000,384,2,0,0,1,700\n",
      "512 384\n4 0 0 1\n0 4 0 2\n0 0 1 700\n700\n1000\n0\n0\n1\nExtrinsic\n1 0 0 0\n0 1 0 0\n0 0 1 700\n0 0 "
      "0 "
      "1\nIntrinsic\n4 0 0 1\n0 4 0 2\n0 0 1 0\n",
      R"({"deepdrr": [{"intrinsic": [[4000,0,512],[0,4000,384],[0,0,1]], "extrinsic": [[1,0,0,0],[0,1,0,0],)"
      R"([0,0,1,700],[0,0,0,1]], "sensor_width": 1024, "sensor_height": 768}]})",
      "NRRD0004\nsizes: 1024 768\nProjection Matrix:=[[4000,0,512,1],[0,4000,384,2],[0,0,1,700]]\n\n"};
}

}  // namespace helicarm::fuzz
