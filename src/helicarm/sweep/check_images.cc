// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/check_images.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <mutex>

#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/sweep/estimate_frame.h"

namespace helicarm::sweep {
namespace {

namespace fs = std::filesystem;
using geometry::View;

/// PFM as plastimatch reads it: the first row first.
void write_rows(const fs::path& file, const image::Image<float>& image, int first, int count) {
  const auto bytes = std::size_t(count) * std::size_t(image.width()) * sizeof(float);
  write_bytes(file, fmt::format("Pf\n{} {}\n-1\n", image.width(), count),
              {reinterpret_cast<const char*>(image.row(first)), bytes});
}

/// Line integrals of the attenuation, up to a factor and a constant.
image::Image<float> attenuation_of(const xray::XrayImage& xray_image) {
  constexpr double open_share = 0.995;
  constexpr float least = 1e-3f;  // of the open beam
  image::Image<float> image = xray_image.pixels;
  const auto pixels = image.pixels();
  if (xray_image.acquisition.logarithmic.value_or(false)) {
    for (float& value : pixels) value = xray_image.highest - value;
    return image;
  }
  std::vector<float> ranked(pixels.begin(), pixels.end());
  const auto rank = ranked.begin() + std::ptrdiff_t(open_share * double(ranked.size()));
  std::ranges::nth_element(ranked, rank);
  const float open = std::max(1e-6f, *rank - xray_image.lowest);
  for (float& value : pixels) value = -std::log(std::max(least, (value - xray_image.lowest) / open));
  return image;
}

}  // namespace

View Upright::operator()(View view) const {
  geometry::Intrinsics& k = view.intrinsics;
  geometry::RigidTransform& pose = view.camera_from_world;
  if (transposed) {
    std::swap(k.fx, k.fy);
    std::swap(k.u0, k.v0);
    pose.rotation.row(0).swap(pose.rotation.row(1));
    std::swap(pose.translation.x(), pose.translation.y());
  }
  for (const Eigen::Index row : {0, 1})
    if (double& f = row == 0 ? k.fx : k.fy; f < 0) {
      f = -f;
      pose.rotation.row(row) *= -1;
      pose.translation[row] *= -1;
    }
  return view;
}
image::Image<float> Upright::operator()(image::Image<float> image) const {
  if (!transposed) return image;
  image::Image<float> turned(image.height(), image.width());
  for (int v = 0; v < turned.height(); ++v)
    for (int u = 0; u < turned.width(); ++u) turned(u, v) = image(v, u);
  return turned;
}

Upright upright_of(const Sweep& sweep, const Cameras& own) {
  const View& view = own[own.size() / 2];
  const Eigen::Vector3d& middle = sweep.path->isocentre;
  const Eigen::Vector2d along = view.project(middle + *sweep.path->axis) - view.project(middle);
  return {std::abs(along.x()) > std::abs(along.y())};
}

Rows rows_of(const std::vector<CheckBox>& boxes, const std::vector<Cameras>& geometries,
             const Upright& upright, int height) {
  constexpr int margin = 4;
  std::vector<std::pair<double, double>> spans;
  for (std::size_t i = 0; i < geometries.front().size(); ++i) {
    double lowest = height, highest = 0;
    for (std::size_t g = 0; g < boxes.size(); ++g)
      for (const Eigen::Vector3d& corner : corners_of(boxes[g])) {
        const double v = upright(geometries[g][i]).project(corner).y();
        lowest = std::min(lowest, v), highest = std::max(highest, v);
      }
    spans.emplace_back(std::max(0.0, lowest), std::min<double>(height - 1, highest));
  }
  Rows rows;
  for (const auto& [lowest, highest] : spans)
    rows.count = std::max(rows.count, int(highest - lowest) + 2 * margin);
  rows.count = std::min(rows.count, height);
  for (const auto& [lowest, highest] : spans)
    rows.first.push_back(std::clamp(int((lowest + highest - rows.count) / 2), 0, height - rows.count));
  return rows;
}

std::string frame_name(std::size_t i, const char* ending) { return fmt::format("img_{:04d}.{}", i, ending); }

void write_bytes(const fs::path& file, std::string_view head, std::string_view body) {
  std::ofstream stream(file, std::ios::binary);
  stream << head << body;
  stream.close();
  if (!stream) throw BadInput(Reason::cannot_write, fmt::format("{}: cannot be written", file.string()));
}

void write_images(const SweepCase& the_case, const std::vector<std::size_t>& frames, const Upright& upright,
                  const std::vector<Rows>& rows, const fs::path& folder, unsigned threads,
                  const std::function<void()>& done) {
  std::mutex guard;
  parallel_for(frames.size(), threads, [&](std::size_t i) {
    const Frame& frame = the_case.frames[frames[i]];
    const image::Image<float> image =
        upright(attenuation_of(value_or_throw(rectified_image_of(frame, the_case))));
    for (std::size_t t = 0; t < rows.size(); ++t)
      write_rows(folder / std::to_string(t) / frame_name(i, "pfm"), image, rows[t].first[i], rows[t].count);
    const std::lock_guard lock(guard);
    done();
  });
}

}  // namespace helicarm::sweep
