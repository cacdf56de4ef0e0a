// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/slices.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "helicarm/image/png.h"

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr int tile_px = 420, caption_px = 26;
constexpr double margin_mm = 15;  // about the bone
constexpr double lowest_hu = -250, highest_hu = 1250;

/// Okabe and Ito (2008), without black and grey.
const std::array<cv::Scalar, 7> colours{
    cv::Scalar(230, 159, 0), cv::Scalar(86, 180, 233),  cv::Scalar(0, 158, 115), cv::Scalar(240, 228, 66),
    cv::Scalar(213, 94, 0),  cv::Scalar(204, 121, 167), cv::Scalar(0, 114, 178)};
cv::Scalar colour_of(const Bone& bone) { return colours[(bone.label - 1U) % colours.size()]; }

/// Axes of a slice: to the right and down, each with its sense.
struct SliceAxes {
  int across, right, down;
  bool right_reversed, down_reversed;
};

/// Of the slice across a voxel axis.
SliceAxes slice_axes(const Eigen::Matrix3d& step, int across) {
  const int p = (across + 1) % 3, q = (across + 2) % 3;
  const auto part = [&](int axis, int patient) {
    return std::abs(step(patient, axis)) / step.col(axis).norm();
  };
  // Vertical is what runs along the body, or from front to back.
  const double upright_p = 4 * part(p, 2) + 2 * part(p, 1), upright_q = 4 * part(q, 2) + 2 * part(q, 1);
  const int down = upright_p > upright_q ? p : q, right = upright_p > upright_q ? q : p;
  const auto sense = [&](int axis, const Vector3d& wanted) { return step.col(axis).dot(wanted) < 0; };
  return {across, right, down, sense(right, {1, 0.9, 0}), sense(down, {0, 0.5, -1})};
}

Vector3i middle_voxel(const Segmentation& made, const Bone& bone) {
  const Eigen::Affine3d voxel_from_patient = made.patient_from_voxel.inverse();
  const Vector3d target = voxel_from_patient * bone.seed.value_or(bone.centre);
  if (bone.seed) return (target.array() + 0.5).floor().cast<int>();
  Vector3i best = bone.low;
  double least = 1e300;
  for (int z = bone.low.z(); z <= bone.high.z(); ++z)
    for (int y = bone.low.y(); y <= bone.high.y(); ++y)
      for (int x = bone.low.x(); x <= bone.high.x(); ++x) {
        const std::size_t i =
            std::size_t(x) +
            std::size_t(made.size.x()) * (std::size_t(y) + std::size_t(made.size.y()) * std::size_t(z));
        if (made.labels[i] != bone.label) continue;
        const double away = (made.patient_from_voxel.linear() * (Vector3d(x, y, z) - target)).squaredNorm();
        if (away < least) least = away, best = {x, y, z};
      }
  return best;
}

cv::Mat tile(const volume::Volume& ct, const Segmentation& made, const Bone& bone, const Vector3i& through,
             int across) {
  const SliceAxes axes = slice_axes(made.patient_from_voxel.linear(), across);
  const Vector3d spacing = made.patient_from_voxel.linear().colwise().norm();
  const Vector3i margin = (margin_mm / spacing.array()).ceil().cast<int>();
  const Vector3i low = (bone.low - margin).cwiseMax(0);
  const Vector3i high = (bone.high + margin).cwiseMin(made.size - Vector3i::Ones());
  const int columns = high[axes.right] - low[axes.right] + 1, rows = high[axes.down] - low[axes.down] + 1;
  cv::Mat grey(rows, columns, CV_8UC1), labels(rows, columns, CV_8UC1);
  cv::Point seed;
  for (int v = 0; v < rows; ++v)
    for (int u = 0; u < columns; ++u) {
      Vector3i at = through;
      at[axes.right] = axes.right_reversed ? high[axes.right] - u : low[axes.right] + u;
      at[axes.down] = axes.down_reversed ? high[axes.down] - v : low[axes.down] + v;
      if (at == through) seed = {u, v};
      const std::size_t i =
          std::size_t(at.x()) + std::size_t(made.size.x()) *
                                    (std::size_t(at.y()) + std::size_t(made.size.y()) * std::size_t(at.z()));
      const double share = (double(ct.voxels[i]) - lowest_hu) / (highest_hu - lowest_hu);
      grey.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(std::lround(255 * std::clamp(share, 0.0, 1.0)));
      labels.at<std::uint8_t>(v, u) = made.labels[i];
    }
  // Square pixels, the longer side fills the tile.
  const double scale = tile_px / std::max(columns * spacing[axes.right], rows * spacing[axes.down]);
  const cv::Size size(std::max(1, int(std::lround(columns * spacing[axes.right] * scale))),
                      std::max(1, int(std::lround(rows * spacing[axes.down] * scale))));
  cv::Mat picture;
  cv::resize(grey, grey, size, 0, 0, cv::INTER_LINEAR);
  cv::cvtColor(grey, picture, cv::COLOR_GRAY2RGB);
  for (const Bone& each : made.bones) {
    cv::Mat mask = labels == each.label;
    cv::resize(mask, mask, size, 0, 0, cv::INTER_NEAREST);
    std::vector<std::vector<cv::Point>> outlines;
    cv::findContours(mask, outlines, cv::RETR_CCOMP, cv::CHAIN_APPROX_NONE);
    cv::drawContours(picture, outlines, -1, colour_of(each), 1);
  }
  if (bone.seed) {
    const cv::Point2d at((seed.x + 0.5) * size.width / columns, (seed.y + 0.5) * size.height / rows);
    cv::drawMarker(picture, at, cv::Scalar(255, 255, 255), cv::MARKER_CROSS, 12, 1, cv::LINE_AA);
  }
  cv::Mat framed = cv::Mat::zeros(tile_px, tile_px, CV_8UC3);
  picture.copyTo(
      framed(cv::Rect((tile_px - size.width) / 2, (tile_px - size.height) / 2, size.width, size.height)));
  return framed;
}

}  // namespace

std::string slices_png(const volume::Volume& ct, const Segmentation& made) {
  const int row_px = tile_px + caption_px;
  cv::Mat sheet = cv::Mat::zeros(std::max(1, int(made.bones.size())) * row_px, 3 * tile_px, CV_8UC3);
  int top = 0;
  for (const Bone& bone : made.bones) {
    const std::string left_out =
        bone.left_out_cm3 == 0 ? "" : fmt::format(", {:.1f} cm3 beside it left out", bone.left_out_cm3);
    cv::putText(sheet, fmt::format("{}: {:.1f} cm3{}", bone.name, bone.volume_cm3, left_out), {8, top + 18},
                cv::FONT_HERSHEY_SIMPLEX, 0.5, colour_of(bone), 1, cv::LINE_AA);
    if (bone.voxels > 0) {
      const Vector3i through = middle_voxel(made, bone);
      for (int k = 0; k < 3; ++k)
        tile(ct, made, bone, through, 2 - k)
            .copyTo(sheet(cv::Rect(k * tile_px, top + caption_px, tile_px, tile_px)));
    }
    top += row_px;
  }
  return image::encode_png(sheet);
}

}  // namespace helicarm::segmentation
