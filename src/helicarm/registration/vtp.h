// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "helicarm/registration/surface_file.h"

namespace helicarm::registration {

/// Whether the file is VTK's XML format.
bool is_vtk_xml(std::string_view bytes);

/// The polygons of a VTK XML PolyData file (.vtp), cut into triangles, and what comments and field data state
/// of space and unit. Arrays may be text, base64 or raw (appended), plain or packed by zlib. Throws BadInput:
/// unsupported (another data set, compressor or encoding, triangle strips), truncated, bad_size, bad_value.
SurfaceFile vtp_surface(std::string_view bytes, const std::string& origin);

}  // namespace helicarm::registration
