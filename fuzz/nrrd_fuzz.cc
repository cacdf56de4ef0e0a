// SPDX-License-Identifier: Apache-2.0
#include "target.h"
#include "volume_target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) { run_volume(bytes); }

std::vector<std::string> seeds() {
  const std::string head = "NRRD0004\n# a comment\ntype: short\ndimension: 3\nsizes: 2 1 2\nendian: little\n";
  return {
      head +
          "encoding: raw\nspace: left-posterior-superior\nspace directions: (1,0,0) (0,2,0) (0,0,3)\n"
          "space origin: (4,5,6)\n\n" +
          voxels16(4),
      head + "encoding: gzip\nspacings: 1 2 3\nkey:=value\nkinds: domain domain domain\n\n" +
          gzipped(voxels16(4)),
      head + "encoding: raw\nspace: RAS\nbyte skip: -1\n\nskipped" + voxels16(4),
      "NRRD0005\ntype: double\ndimension: 3\nsizes: 1 2 1\nencoding: ascii\n\n1.5 -2e3\n",
      "NRRD0005\ntype: uint8\ndimension: 3\nsizes: 1 2 1\nencoding: raw\nendian: big\ndata file: input\n\n"};
}

}  // namespace helicarm::fuzz
