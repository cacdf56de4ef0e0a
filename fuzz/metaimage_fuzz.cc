// SPDX-License-Identifier: Apache-2.0
#include "target.h"
#include "volume_target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) { run_volume(bytes); }

std::vector<std::string> seeds() {
  const std::string head = "ObjectType = Image\nNDims = 3\nDimSize = 2 1 2\n";
  return {
      head +
          "TransformMatrix = 0 1 0 -1 0 0 0 0 -1\nOffset = 5 6 7\nElementSpacing = 2 3 4\nElementType = "
          "MET_SHORT\n"
          "ElementDataFile = LOCAL\n" +
          voxels16(4),
      head +
          "CompressedData = True\nElementType = MET_USHORT\nAnatomicalOrientation = RAI\nBinaryData = True\n"
          "BinaryDataByteOrderMSB = False\nElementDataFile = LOCAL\n" +
          gzipped(voxels16(4)),
      head +
          "HeaderSize = -1\nElementType = MET_FLOAT\nElementNumberOfChannels = 1\nElementDataFile = input\n" +
          std::string(16, '\0')};
}

}  // namespace helicarm::fuzz
