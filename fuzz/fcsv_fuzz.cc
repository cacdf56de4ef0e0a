// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/fcsv.h"
#include "helicarm/core/text.h"
#include "target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) {
  const auto points = guarded([&] { return case_registration::fcsv_points(bytes, "input.fcsv"); });
  if (!points) return;
  for (const case_registration::PlanPoint& point : *points) {
    check(point.in_model.allFinite(), "points are finite");
    check(!holds_control_character(point.name), "a name can be printed");
  }
}

std::vector<std::string> seeds() {
  const std::string columns = "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n";
  return {"# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n" + columns +
              "1,1,2,3,0,0,0,1,1,1,0,entry,\"a, \"\"b\"\"\",vtkMRMLScalarVolumeNode1\n",
          "# Markups fiducial file version = 5.2\n# CoordinateSystem = 0\n" + columns +
              "1,-1.5,+2,3e1,0,0,0,1,1,1,0,exit,,,2,0\n2,0,0,0,0,0,0,1,1,1,0,,,,0,0\n",
          "# CoordinateSystem = RAS\n# units = cm\n# columns = label,x,y,z,sel,vis\nF1,1,2,3,1,1\n"};
}

}  // namespace helicarm::fuzz
