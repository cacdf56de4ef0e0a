// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/segment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/segmentation/bones.h"
#include "helicarm/segmentation/cavities.h"
#include "helicarm/segmentation/watershed.h"

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;
using volume::ByteGrid;

// Muscle and blood end at 80 HU, cancellous bone begins at 100 to 150, cortical bone at 500.
constexpr double least_threshold_hu = 200, most_threshold_hu = 400;
constexpr double noise_sigmas = 4;
constexpr float air_hu = -400;
// Of the voxels of a CT of a limb 1 to 10 % are bone; more than half are another kind of image.
constexpr double most_bone = 0.5;
constexpr double fragment_mm = 1.5;
constexpr std::size_t least_voxels = 50;  // of a bone; noise makes some in cancellous bone near the threshold
// A contact is worth a look from here up to where it joins, and a bone's own neck from there so far on.
constexpr double doubtful_contact = 0.35, doubtful_join = 0.1;

/// The part of the volume that holds bone, with a margin.
struct Work {
  Vector3i first;  ///< voxel of the volume
  ByteGrid bone;
};

std::size_t index_in(const volume::Volume& ct, const Vector3i& at) {
  return std::size_t(at.x()) +
         std::size_t(ct.size.x()) * (std::size_t(at.y()) + std::size_t(ct.size.y()) * std::size_t(at.z()));
}

Vector3i voxel_at(const volume::Volume& ct, const Vector3d& point) {
  return ((ct.patient_from_voxel.inverse() * point).array() + 0.5).floor().cast<int>();
}

bool holds(const volume::Volume& ct, const Vector3d& point) {
  const Vector3d at = ct.patient_from_voxel.inverse() * point;
  return (at.array() >= -0.5).all() && (at.array() < ct.size.cast<double>().array() - 0.5).all();
}

std::string text_of(const Vector3d& p) {
  return fmt::format("({:.1f}, {:.1f}, {:.1f}) mm", p.x(), p.y(), p.z());
}

void check_seeds(const volume::Volume& ct, std::span<const Seed> seeds) {
  if (seeds.empty()) throw BadInput(Reason::bad_value, "no seed: a bone needs a name and a point of it");
  if (seeds.size() > most_bones) throw BadInput(Reason::bad_size, fmt::format("over {} seeds", most_bones));
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    const Seed& seed = seeds[i];
    value_or_throw(check_name(seed.name));
    for (std::size_t k = 0; k < i; ++k)
      if (seeds[k].name == seed.name)
        throw BadInput(Reason::name_clash, fmt::format("{}: two seeds have this name", seed.name));
    if (!seed.point.allFinite())
      throw BadInput(Reason::not_finite, fmt::format("{}: the seed is not finite", seed.name));
    if (holds(ct, seed.point)) continue;
    const Eigen::AlignedBox3d box =
        Eigen::AlignedBox3d(Vector3d::Zero(), (ct.size.cast<double>().array() - 1).matrix())
            .transformed(ct.patient_from_voxel);
    const bool as_ras = holds(ct, seed.point.cwiseProduct(Vector3d(-1, -1, 1)));
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: the seed {} lies outside the CT, which extends from {} to {} (L, P, S){}",
                               seed.name, text_of(seed.point), text_of(box.min()), text_of(box.max()),
                               as_ras ? "; as R, A, S it lies inside" : ""));
  }
}

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

bool on_bone(const Work& work, const Vector3i& voxel) {
  const Vector3i at = voxel - work.first;
  return work.bone.has(at) && work.bone.values[work.bone.index(at)] != empty;
}

/// Refuses a seed that is on no bone.
void check_on_bone(const volume::Volume& ct, const Work& work, const Seed& seed, double threshold) {
  const Vector3i voxel = voxel_at(ct, seed.point);
  if (on_bone(work, voxel)) return;
  double least = std::numeric_limits<double>::infinity();
  Vector3d nearest = Vector3d::Zero();
  std::size_t i = 0;
  work.bone.each([&](const Vector3i& at) {
    if (work.bone.values[i++] == empty) return;
    const Vector3d point = ct.patient_from_voxel * (at + work.first).cast<double>();
    if (const double away = (point - seed.point).squaredNorm(); away < least) least = away, nearest = point;
  });
  least = std::sqrt(least);
  const Vector3d as_ras = seed.point.cwiseProduct(Vector3d(-1, -1, 1));
  const bool is_ras = holds(ct, as_ras) && on_bone(work, voxel_at(ct, as_ras));
  const double hu = double(ct.voxels[index_in(ct, voxel)]);
  throw BadInput(
      {Reason::seed_off_bone,
       fmt::format("{}: the seed {} has {:.0f} HU, bone begins at {:g}; the nearest bone is {:.1f} "
                   "mm away at {}: click on the bone, or lower the threshold{}",
                   seed.name, text_of(seed.point), hu, threshold, least, text_of(nearest),
                   is_ras ? "; as R, A, S the seed lies on bone" : ""),
       {},
       {{"hu", hu}, {"threshold_hu", threshold}, {"nearest_mm", least}}});
}

/// The regions of the seeds, which must differ.
std::vector<std::uint32_t> regions_of(const volume::Volume& ct, const Work& work, std::span<const Seed> seeds,
                                      Watershed& regions) {
  std::vector<std::uint32_t> found;
  for (const Seed& seed : seeds) {
    const std::uint32_t region = regions.region_at(work.bone.index(voxel_at(ct, seed.point) - work.first));
    if (const auto same = std::ranges::find(found, region); same != found.end()) {
      const Seed& other = seeds[std::size_t(same - found.begin())];
      throw BadInput(
          {Reason::seeds_in_one_bone,
           fmt::format("the seeds {} {} and {} {} are on one bone: between them it is never narrower "
                       "than {:g} of its radius; leave one out, or raise the threshold where two "
                       "bones have grown together in the CT",
                       other.name, text_of(other.point), seed.name, text_of(seed.point), surely_one),
           {},
           {{"distance_mm", (other.point - seed.point).norm()}}});
    }
    found.push_back(region);
  }
  return found;
}

/// Where a bone's parts were joined over the relatively narrowest neck.
struct Join {
  double width = 1;
  Neck neck;
};

/// Joins the regions that are one bone; the regions of seeds never. Of each region the narrowest join.
std::vector<Join> join_regions(Watershed& regions, const std::vector<std::uint32_t>& of_seeds,
                               double neck_width, std::uint16_t small) {
  std::vector<char> seeded(regions.joined.size(), 0);
  for (const std::uint32_t region : of_seeds) seeded[region] = 1;
  std::vector<Join> narrowest(regions.joined.size());
  for (const Neck& neck : regions.necks) {
    const std::uint32_t a = regions.root(neck.a), b = regions.root(neck.b);
    if (a == b || (seeded[a] && seeded[b])) continue;
    const double width = regions.width(neck);
    const bool is_fragment = std::min(regions.depths[a], regions.depths[b]) <= small;
    if (width < neck_width && !is_fragment) continue;
    Join join = narrowest[a].width < narrowest[b].width ? narrowest[a] : narrowest[b];
    if (!is_fragment && width < join.width) join = {width, neck};
    const char has_seed = seeded[a] | seeded[b];
    const std::uint32_t both = regions.join(a, b);
    narrowest[both] = join;
    seeded[both] = has_seed;
  }
  return narrowest;
}

/// Contacts of the bones, the widest with each other one, and the doubtful ones as warnings.
template <class PointOf>
void add_contacts(Segmentation& made, Watershed& regions, const std::vector<std::uint8_t>& label_of,
                  const PointOf& point_of, double unit_mm) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> met;
  for (const Neck& neck : regions.necks) {  // the deepest first
    const auto [a, b] = std::minmax({regions.root(neck.a), regions.root(neck.b)});
    if (a == b || (label_of[a] == 0 && label_of[b] == 0) || !met.emplace(a, b).second) continue;
    const auto name_of = [&](std::uint32_t region) {
      return label_of[region] == 0 ? std::string() : made.bones[label_of[region] - 1U].name;
    };
    Contact contact{"", neck.depth * unit_mm, regions.width(neck), point_of(neck)};
    for (const auto& [own, other] : {std::pair(a, b), std::pair(b, a)})
      if (label_of[own] != 0) {
        contact.with = name_of(other);
        made.bones[label_of[own] - 1U].contacts.push_back(contact);
      }
    if (contact.width < doubtful_contact) continue;
    const std::string first = label_of[a] != 0 ? name_of(a) : name_of(b);
    const std::string second = label_of[a] != 0 ? name_of(b) : "";
    made.warnings.push_back(
        {Reason::bones_in_contact,
         fmt::format(
             "{}: meets {} over a contact of {:.1f} mm radius, {:.2f} of the smaller one's, at {}: look "
             "at the outline there{}",
             first, second.empty() ? "another bone" : second, contact.neck_mm, contact.width,
             text_of(contact.at), second.empty() ? "; if it is the same bone, give a neck below that" : ""),
         {},
         {{"neck_mm", contact.neck_mm}, {"width", contact.width}}});
  }
}

}  // namespace

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

Expected<Segmentation> segment(const volume::Volume& ct, std::span<const Seed> seeds,
                               const SegmentOptions& options, const pipeline::Progress& progress) {
  return guarded([&] {
    value_or_throw(check_fields<SegmentOptions>(segment_fields, options, "segment"));
    check_seeds(ct, seeds);
    progress.begin("threshold");
    const double threshold = options.threshold_hu.value_or(usual_threshold(ct));
    Work work = thresholded(ct, threshold, options.gap_mm, progress);
    progress.begin("fill");
    const ChamferSteps steps(ct.patient_from_voxel.linear());
    fill_cavities(work.bone, steps, options.gap_mm, outside_of(ct, work), progress);
    for (const Seed& seed : seeds) check_on_bone(ct, work, seed, threshold);
    progress.begin("distance");
    const auto depths =
        distances_to(work.bone, steps, progress, [](std::uint8_t value) { return value == empty; });
    progress.begin("watershed");
    const double largest_spacing = ct.patient_from_voxel.linear().colwise().norm().maxCoeff();
    const auto small = static_cast<std::uint16_t>(
        std::min(double(farthest), std::max(fragment_mm, 1.5 * largest_spacing) / steps.unit_mm));
    Watershed regions = watershed_of(depths, work.bone.size, small, progress);
    const auto of_seeds = regions_of(ct, work, seeds, regions);
    const auto narrowest = join_regions(regions, of_seeds, options.neck, small);

    progress.begin("label");
    Segmentation made;
    made.size = ct.size;
    made.patient_from_voxel = ct.patient_from_voxel;
    made.threshold_hu = threshold;
    made.labels.assign(ct.voxels.size(), 0);
    std::vector<std::uint8_t> label_of(regions.joined.size(), 0);
    for (std::size_t i = 0; i < seeds.size(); ++i) {
      Bone& bone = made.bones.emplace_back();
      bone.name = seeds[i].name;
      bone.seed = seeds[i].point;
      bone.seed_hu = double(ct.voxels[index_in(ct, voxel_at(ct, seeds[i].point))]);
      bone.label = label_of[regions.root(of_seeds[i])] = static_cast<std::uint8_t>(i + 1);
    }
    std::size_t i = 0;
    work.bone.each([&](const Vector3i& at) {
      if (const std::uint32_t region = regions.labels[i++]; region != 0)
        made.labels[index_in(ct, at + work.first)] = label_of[regions.root(region - 1)];
    });
    measure_bones(made);
    for (const Bone& bone : made.bones)
      if (bone.voxels < least_voxels)
        throw BadInput(
            {Reason::seed_off_bone,
             fmt::format("{}: the seed {} lies on a speck of {} voxels, a bone has {} or more: click on "
                         "the bone, or lower the threshold ({:g} HU)",
                         bone.name, text_of(*bone.seed), bone.voxels, least_voxels, threshold),
             {},
             {{"voxels", double(bone.voxels)}, {"threshold_hu", threshold}}});
    const auto point_of = [&](const Neck& neck) -> Vector3d {
      return ct.patient_from_voxel * (voxel_of(neck.at, work.bone.size) + work.first).cast<double>();
    };
    add_contacts(made, regions, label_of, point_of, steps.unit_mm);
    for (std::size_t k = 0; k < seeds.size(); ++k)
      if (const Join& join = narrowest[regions.root(of_seeds[k])]; join.width < options.neck + doubtful_join)
        made.warnings.push_back(
            {Reason::bones_in_contact,
             fmt::format(
                 "{}: is narrow at {}: a neck of {:.1f} mm radius, {:.2f} of the smaller part's: if two "
                 "bones meet there, give each a seed, or a neck above that",
                 seeds[k].name, text_of(point_of(join.neck)), join.neck.depth * steps.unit_mm, join.width),
             {},
             {{"neck_mm", join.neck.depth * steps.unit_mm}, {"width", join.width}}});
    return made;
  });
}

}  // namespace helicarm::segmentation
