// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/parts.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

// Muscle and blood end at 80 HU, cancellous bone begins at 100 to 150, cortical bone at 500.
constexpr double least_threshold_hu = 200, most_threshold_hu = 400;
constexpr double noise_sigmas = 4;
constexpr float air_hu = -400;
// Of the voxels of a CT of a limb 1 to 10 % are bone; more than half are another kind of image.
constexpr double most_bone = 0.5;
constexpr double fragment_mm = 1.5;
// The neck's radius relative to the bone's within 1.5 of its radii: a bone's neck has a length, there it is
// 0.85 and more. Where two balls meet it is 0.55: their depth grows from the rim of the contact; 0.68 of two
// metacarpals.
constexpr double length_in_radii = 1.5, has_length = 0.8;
// What then suffices of the option's width: a femoral neck has half its head's radius.
constexpr double long_neck_share = 2.0 / 3;

Work thresholded(const volume::Volume& ct, double threshold, double margin_mm,
                 const pipeline::Progress& progress) {
  Vector3i low = ct.size, high = Vector3i::Constant(-1);
  std::size_t i = 0, dense_voxels = 0;
  for (int z = 0; z < ct.size.z(); ++z) {
    if (progress.view) progress.view();
    for (int y = 0; y < ct.size.y(); ++y)
      for (int x = 0; x < ct.size.x(); ++x, ++i)
        if (double(ct.voxels[i]) >= threshold) {
          ++dense_voxels;
          low = low.cwiseMin(Vector3i(x, y, z));
          high = high.cwiseMax(Vector3i(x, y, z));
        }
  }
  const auto [least, greatest] = std::ranges::minmax(ct.voxels);
  if (dense_voxels == 0)
    throw BadInput({Reason::bad_value,
                    fmt::format("no voxel reaches the threshold {:g} HU: the CT's values are {:g} to {:g}; "
                                "give a threshold within them, or check that they are Hounsfield units",
                                threshold, least, greatest),
                    {},
                    {{"threshold_hu", threshold}}});
  if (double(dense_voxels) > most_bone * double(ct.voxels.size()))
    throw BadInput(
        {Reason::bad_value,
         fmt::format("{:.0f} % of the voxels reach the threshold {:g} HU (values {:g} to {:g}): bone "
                     "fills less than half of a CT; give a higher threshold, or check that the "
                     "values are Hounsfield units",
                     100 * double(dense_voxels) / double(ct.voxels.size()), threshold, least, greatest),
         {},
         {{"threshold_hu", threshold}}});
  const Vector3d spacing = ct.patient_from_voxel.linear().colwise().norm();
  const Vector3i margin = (margin_mm / spacing.array()).ceil().cast<int>() + 2;
  low = (low - margin).cwiseMax(0);
  high = (high + margin).cwiseMin(ct.size - Vector3i::Ones());
  Work work{low, volume::byte_grid(high - low + Vector3i::Ones())};
  i = 0;
  for (int z = low.z(); z <= high.z(); ++z)
    for (int y = low.y(); y <= high.y(); ++y) {
      const float* row = ct.voxels.data() + index_in(ct, {low.x(), y, z});
      for (int x = low.x(); x <= high.x(); ++x)
        work.bone.values[i++] = double(*row++) >= threshold ? dense : empty;
    }
  return work;
}

/// Voxels of the grid's faces that are outside every bone: within the volume the margin, on its own faces
/// air. Marrow of a bone that the volume cuts off is neither.
std::vector<std::uint32_t> outside_of(const volume::Volume& ct, const Work& work) {
  std::vector<std::uint32_t> outside;
  const Vector3i& size = work.bone.size;
  for (int axis = 0; axis < 3; ++axis) {
    const int p = (axis + 1) % 3, q = (axis + 2) % 3;
    for (const int face : {0, size[axis] - 1}) {
      const int of_volume = work.first[axis] + face;
      const bool within = of_volume > 0 && of_volume + 1 < ct.size[axis];
      for (int i = 0; i < size[p]; ++i)
        for (int j = 0; j < size[q]; ++j) {
          Vector3i at;
          at[axis] = face, at[p] = i, at[q] = j;
          if (within || ct.voxels[index_in(ct, at + work.first)] < air_hu)
            outside.push_back(static_cast<std::uint32_t>(work.bone.index(at)));
        }
    }
  }
  return outside;
}

/// Whether a neck of that width joins a bone's parts by its length.
bool is_long_neck(Watershed& regions, const Neck& neck, const DepthMap& depth, double width,
                  double neck_width) {
  return width >= long_neck_share * neck_width &&
         regions.local_width(neck, depth, length_in_radii) >= has_length;
}

}  // namespace

std::size_t index_in(const volume::Volume& ct, const Vector3i& at) {
  return std::size_t(at.x()) +
         std::size_t(ct.size.x()) * (std::size_t(at.y()) + std::size_t(ct.size.y()) * std::size_t(at.z()));
}

std::string text_of(const Vector3d& p) {
  return fmt::format("({:.1f}, {:.1f}, {:.1f}) mm", p.x(), p.y(), p.z());
}

std::vector<Join> join_regions(Parts& parts, const std::vector<std::uint32_t>& of_seeds, double neck_width) {
  Watershed& regions = parts.regions;
  std::vector<char> seeded(regions.joined.size(), 0);
  for (const std::uint32_t region : of_seeds) seeded[region] = 1;
  std::vector<Join> narrowest(regions.joined.size());
  for (const Neck& neck : regions.necks) {
    const std::uint32_t a = regions.root(neck.a), b = regions.root(neck.b);
    if (a == b || (seeded[a] && seeded[b])) continue;
    const bool is_fragment = std::min(regions.depths[a], regions.depths[b]) <= parts.small;
    const double width = is_fragment ? 1 : regions.local_width(neck, parts.depth());
    if (width < neck_width && !is_fragment && !is_long_neck(regions, neck, parts.depth(), width, neck_width))
      continue;
    Join join = narrowest[a].width < narrowest[b].width ? narrowest[a] : narrowest[b];
    if (!is_fragment && width < join.width) join = {width, neck};
    const char has_seed = seeded[a] | seeded[b];
    const std::uint32_t both = regions.join(a, b);
    narrowest[both] = join;
    seeded[both] = has_seed;
  }
  return narrowest;
}

Parts parts_of(const volume::Volume& ct, const SegmentOptions& options, const pipeline::Progress& progress) {
  Parts made;
  progress.begin("threshold");
  made.threshold = options.threshold_hu.value_or(usual_threshold(ct));
  made.work = thresholded(ct, made.threshold, options.gap_mm, progress);
  progress.begin("fill");
  const Eigen::Matrix3d mm_from_voxel = ct.patient_from_voxel.linear();
  fill_cavities(made.work.bone, mm_from_voxel, options.gap_mm, outside_of(ct, made.work), progress);
  progress.begin("distance");
  const ChamferSteps steps(mm_from_voxel);
  made.unit_mm = steps.unit_mm;
  made.spacing = mm_from_voxel.colwise().norm() / steps.unit_mm;
  made.distances =
      distances_to(made.work.bone, steps, progress, [](std::uint8_t value) { return value == empty; });
  progress.begin("watershed");
  const double small_mm = std::max(fragment_mm, 1.5 * mm_from_voxel.colwise().norm().maxCoeff());
  made.small = static_cast<std::uint16_t>(std::min(double(farthest), small_mm / steps.unit_mm));
  made.regions = watershed_of(made.distances, made.work.bone.size, made.small, progress);
  return made;
}

std::vector<std::size_t> sizes_of(Watershed& regions) {
  std::vector<std::size_t> own(regions.joined.size(), 0), sizes(regions.joined.size(), 0);
  for (const std::uint32_t label : regions.labels)
    if (label != 0) ++own[label - 1];
  for (std::size_t i = 0; i < own.size(); ++i) sizes[regions.root(static_cast<std::uint32_t>(i))] += own[i];
  return sizes;
}

double usual_threshold(const volume::Volume& ct) {
  // Soft tissue, 5 HU wide: its voxels from 0 to 100 HU and the noise above them.
  constexpr double width = 5, last = 400;
  constexpr std::size_t bins = std::size_t(last / width), most_modes = std::size_t(100 / width);
  constexpr std::size_t most_samples = 2'000'000;
  std::array<double, bins> counts{};
  constexpr double air = -500;
  double matter = 0, soft = 0;
  for (std::size_t i = 0; i < ct.voxels.size(); i += 1 + ct.voxels.size() / most_samples) {
    const double hu = double(ct.voxels[i]), bin = hu / width;
    matter += hu > air;
    if (bin >= 0 && bin < double(bins)) ++counts[std::size_t(bin)], soft += bin < double(most_modes);
  }
  // Of what is no air: 3 to 6 % where all but a bone was removed, whose marrow says nothing of the noise.
  constexpr double least_soft = 0.15;
  if (soft < least_soft * matter) return least_threshold_hu;
  const auto mode =
      std::size_t(std::max_element(counts.begin(), counts.begin() + most_modes) - counts.begin());
  std::size_t end = mode;
  while (end + 1 < bins && counts[end] > 0.6065 * counts[mode]) ++end;  // exp(-1/2): one standard deviation
  const double reach = (double(mode) + 0.5) * width + noise_sigmas * double(end - mode) * width;
  return std::clamp(std::round(reach / 10) * 10, least_threshold_hu, most_threshold_hu);
}

}  // namespace helicarm::segmentation
