// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/phantom/mesh.h"

namespace helicarm::phantom {

/// The closed surface with fewer triangles: edges are collapsed in the order of their quadric error (Garland,
/// Heckbert 1997) while every corner of the given mesh stays within `tolerance_mm` of the result. It stays
/// closed.
TriangleMesh simplified(const TriangleMesh& mesh, double tolerance_mm);

}  // namespace helicarm::phantom
