// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/surface.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

phantom::TriangleMesh tetrahedron() {
  return {{{0, 0, 0}, {10, 0, 0}, {0, 10, 0}, {0, 0, 20}}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

std::string text_stl() {
  std::string text = "solid t SPACE=RAS units=mm\n";
  const auto mesh = tetrahedron();
  for (const auto& triangle : mesh.triangles) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const auto corner : triangle)
      text += "vertex " + std::to_string(mesh.corners[corner].x()) + " " +
              std::to_string(mesh.corners[corner].y()) + " " + std::to_string(mesh.corners[corner].z()) +
              "\n";
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid t\n";
}

std::string vtp(const std::string& field) {
  return "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\">\n<PolyData>\n" +
         field +
         "<Piece NumberOfPoints=\"4\" NumberOfPolys=\"4\" NumberOfStrips=\"0\">\n<Points>\n"
         "<DataArray type=\"Float32\" format=\"ascii\">\n0 0 0 10 0 0 0 10 0 0 0 "
         "20\n</DataArray>\n</Points>\n"
         "<Polys>\n<DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">\n0 2 1 0 1 3 0 3 2 1 2 "
         "3\n"
         "</DataArray>\n<DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">\n3 6 9 "
         "12\n</DataArray>\n"
         "</Polys>\n</Piece>\n</PolyData>\n</VTKFile>\n";
}

std::string legacy_vtk(const std::string& coding, const std::string& points, const std::string& cells,
                       const std::string& version = "3.0") {
  return "# vtk DataFile Version " + version + "\nSPACE=RAS\n" + coding +
         "\nDATASET POLYDATA\nFIELD FieldData 1\na 1 1 int\n" +
         (coding == "ASCII" ? "1" : std::string("\0\0\0\1", 4)) + "\nPOINTS 4 float\n" + points + "\n" +
         cells;
}

}  // namespace

void run(std::string_view bytes) {
  const auto surface = registration::surface_from(bytes, "input");
  if (!surface) return;
  check(surface->triangles.size() >= 4, "a surface has triangles");
  for (const auto& corner : surface->corners) {
    check(corner.allFinite(), "corners are finite");
    check(corner.norm() <= 10001, "corners are near");
  }
  for (const auto& triangle : surface->triangles)
    for (const auto corner : triangle) check(corner < surface->corners.size(), "triangles name corners");
  const auto prepared = registration::prepare_surface(*surface, "input");
  if (!prepared) return;
  check(prepared->normals.size() == prepared->mesh.triangles.size(), "each triangle has a normal");
  check(!(phantom::volume(prepared->mesh) < 0), "a surface is outside out");
}

std::vector<std::string> seeds() {
  const std::string ply =
      "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\n"
      "property list uchar int vertex_indices\nend_header\n0 0 0\n10 0 0\n0 10 0\n0 0 20\n"
      "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
  return {phantom::to_stl(tetrahedron()),
          text_stl(),
          "ply\nformat ascii 1.0\ncomment SPACE=LAS\nobj_info units: cm\n" + ply,
          vtp(""),
          vtp("<FieldData>\n<Array type=\"String\" Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">\n"
              "82 65 83 0\n</Array>\n</FieldData>\n"),
          "# SPACE=RAS\ng a\nv 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 20\nf 1 3 2\nf 1//1 2//1 4//1\nf -4 -1 -2\nf "
          "2/1 3/1 4/1\n",
          legacy_vtk("ASCII", "0 0 0 10 0 0 0 10 0 0 0 20",
                     "POLYGONS 4 16\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"),
          legacy_vtk("BINARY",
                     std::string("\0\0\0\0\0\0\0\0\0\0\0\0\x41\x20\0\0\0\0\0\0\0\0\0\0"
                                 "\0\0\0\0\x41\x20\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x41\xA0\0\0",
                                 48),
                     "TRIANGLE_STRIPS 1 7\n" + std::string("\0\0\0\6\0\0\0\0\0\0\0\2\0\0\0\1\0\0\0\3\0\0\0\0"
                                                           "\0\0\0\2",
                                                           28)),
          legacy_vtk("ASCII", "0 0 0 10 0 0 0 10 0 0 0 20",
                     "POLYGONS 5 12\nOFFSETS vtktypeint64\n0 3 6 9 12\nCONNECTIVITY vtktypeint64\n"
                     "0 2 1 0 1 3 0 3 2 1 2 3\n",
                     "5.1")};
}

}  // namespace helicarm::fuzz
