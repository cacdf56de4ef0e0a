// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/phantom/mesh.h"
#include "helicarm/segmentation/segment.h"

namespace helicarm::segmentation {

/// The closed surface of a bone, patient frame, mm. Where the CT shows the edge it lies there
/// (`volume::bone_edge`). Its triangles' edges are about as long as the voxels, of a large bone longer (a
/// 400th of its box's diagonal).
phantom::TriangleMesh surface_of(const volume::Volume& ct, const Segmentation& made, const Bone& bone);

double area_cm2(const phantom::TriangleMesh& mesh);

/// Binary STL whose header states LPS and mm.
std::string stl_in_lps(const phantom::TriangleMesh& mesh);

}  // namespace helicarm::segmentation
