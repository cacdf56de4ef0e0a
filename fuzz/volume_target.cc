// SPDX-License-Identifier: Apache-2.0
#include "volume_target.h"

#include <cmath>

#include <zlib.h>

#include "helicarm/volume/read_volume.h"
#include "target.h"

namespace helicarm::fuzz {

void check_volume(const Expected<volume::Volume>& volume) {
  if (!volume) return;
  check(volume->size.minCoeff() >= 1, "a volume has voxels");
  check(volume->voxels.size() == std::size_t(volume->size.cast<std::int64_t>().prod()),
        "the voxel count matches the size");
  for (const float voxel : volume->voxels) check(std::isfinite(voxel), "voxels are finite");
  check(volume->patient_from_voxel.matrix().allFinite(), "positions are finite");
  const Eigen::Matrix3d cell = volume->patient_from_voxel.linear();
  check(std::abs(cell.determinant()) > 1e-10, "the voxel-to-patient transform is not singular");
}

void run_volume(std::string_view bytes) { check_volume(volume::read_volume(put_file("input", bytes))); }

std::string voxels16(int count) {
  std::string bytes;
  for (int i = 0; i < count; ++i) bytes += {static_cast<char>(i), static_cast<char>(i >> 8)};
  return bytes;
}

std::string gzipped(const std::string& bytes) {
  z_stream stream{};
  deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
  std::string out(compressBound(bytes.size()) + 32, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

}  // namespace helicarm::fuzz
