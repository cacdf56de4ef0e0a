// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "helicarm/phantom/mesh.h"

namespace helicarm::registration {

/// A side of a face: lower corner, upper corner, face.
using FaceSide = std::array<std::uint32_t, 3>;

/// The sides of all faces, sorted: those of one edge follow one another.
std::vector<FaceSide> face_sides(const phantom::TriangleMesh& mesh);

/// The mesh with corners at one place joined; triangles without three corners are left out. Places may differ
/// by rounding: by 1e-7 of the size, and where edges stay open by up to 1e-5. Corners must be finite.
phantom::TriangleMesh welded(const phantom::TriangleMesh& soup);

}  // namespace helicarm::registration
