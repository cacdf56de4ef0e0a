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
constexpr double doubtful_contact = 0.45, doubtful_join = 0.1;

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
std::vector<Join> join_regions(Watershed& regions, const DepthMap& depth,
                               const std::vector<std::uint32_t>& of_seeds, double neck_width,
                               std::uint16_t small) {
  std::vector<char> seeded(regions.joined.size(), 0);
  for (const std::uint32_t region : of_seeds) seeded[region] = 1;
  std::vector<Join> narrowest(regions.joined.size());
  for (const Neck& neck : regions.necks) {
    const std::uint32_t a = regions.root(neck.a), b = regions.root(neck.b);
    if (a == b || (seeded[a] && seeded[b])) continue;
    const bool is_fragment = std::min(regions.depths[a], regions.depths[b]) <= small;
    const double width = is_fragment ? 1 : regions.local_width(neck, depth);
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

/// What the watershed made of a volume's bone.
struct Parts {
  Work work;
  double threshold = 0, unit_mm = 0;
  std::vector<std::uint16_t> distances;
  Vector3d spacing;     ///< in the unit of the distances
  std::uint16_t small;  ///< a fragment's depth
  Watershed regions;

  DepthMap depth() const { return {distances, work.bone.size, spacing}; }
};

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

/// Voxels of each region with those that were joined to it.
std::vector<std::size_t> sizes_of(Watershed& regions) {
  std::vector<std::size_t> own(regions.joined.size(), 0), sizes(regions.joined.size(), 0);
  for (const std::uint32_t label : regions.labels)
    if (label != 0) ++own[label - 1];
  for (std::size_t i = 0; i < own.size(); ++i) sizes[regions.root(static_cast<std::uint32_t>(i))] += own[i];
  return sizes;
}

/// The voxel nearest to a point of a bone that is no speck; as text and, in mm, in `figures`.
std::string nearest_bone(const volume::Volume& ct, Parts& parts, const Vector3d& point,
                         std::map<std::string, double>& figures) {
  const std::vector<std::size_t> sizes = sizes_of(parts.regions);
  double least = std::numeric_limits<double>::infinity();
  Vector3d nearest = Vector3d::Zero();
  std::size_t i = 0;
  parts.work.bone.each([&](const Vector3i& at) {
    const std::size_t k = i++;
    if (parts.regions.labels[k] == 0) return;
    const Vector3d here = ct.patient_from_voxel * (at + parts.work.first).cast<double>();
    const double away = (here - point).squaredNorm();
    if (away < least && sizes[parts.regions.region_at(k)] >= least_voxels) least = away, nearest = here;
  });
  if (!std::isfinite(least)) return fmt::format("no bone has {} voxels or more", least_voxels);
  figures["nearest_mm"] = std::sqrt(least);
  return fmt::format("the nearest bone is {:.1f} mm away at {}", std::sqrt(least), text_of(nearest));
}

/// Refuses seeds that are on no bone.
void check_on_bone(const volume::Volume& ct, Parts& parts, std::span<const Seed> seeds, double neck) {
  for (const Seed& seed : seeds) {
    const Vector3i voxel = voxel_at(ct, seed.point);
    if (on_bone(parts.work, voxel)) continue;
    join_regions(parts.regions, parts.depth(), {}, neck, parts.small);
    const Vector3d as_ras = seed.point.cwiseProduct(Vector3d(-1, -1, 1));
    const bool is_ras = holds(ct, as_ras) && on_bone(parts.work, voxel_at(ct, as_ras));
    const double hu = double(ct.voxels[index_in(ct, voxel)]);
    std::map<std::string, double> figures{{"hu", hu}, {"threshold_hu", parts.threshold}};
    const std::string nearest = nearest_bone(ct, parts, seed.point, figures);
    throw BadInput({Reason::seed_off_bone,
                    fmt::format("{}: the seed {} has {:.0f} HU, bone begins at {:g}; {}: click on the bone, "
                                "or lower the threshold{}",
                                seed.name, text_of(seed.point), hu, parts.threshold, nearest,
                                is_ras ? "; as R, A, S the seed lies on bone" : ""),
                    {},
                    std::move(figures)});
  }
}

/// Refuses bones that are specks.
void check_sizes(const volume::Volume& ct, Parts& parts, const Segmentation& made) {
  for (const Bone& bone : made.bones) {
    if (bone.voxels >= least_voxels) continue;
    std::map<std::string, double> figures{{"voxels", double(bone.voxels)}, {"threshold_hu", parts.threshold}};
    const std::string nearest = nearest_bone(ct, parts, *bone.seed, figures);
    throw BadInput(
        {Reason::seed_off_bone,
         fmt::format("{}: the seed {} lies on a speck of {} voxels, a bone has {} or more; {}: "
                     "click on the bone, or lower the threshold ({:g} HU)",
                     bone.name, text_of(*bone.seed), bone.voxels, least_voxels, nearest, parts.threshold),
         {},
         std::move(figures)});
  }
}

/// Bones and labels of the regions of the seeds. `label_of`: of regions.
Segmentation labelled(const volume::Volume& ct, Parts& parts, std::span<const Seed> seeds,
                      const std::vector<std::uint32_t>& of_seeds, std::vector<std::uint8_t>& label_of) {
  Segmentation made;
  made.size = ct.size;
  made.patient_from_voxel = ct.patient_from_voxel;
  made.threshold_hu = parts.threshold;
  made.labels.assign(ct.voxels.size(), 0);
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    Bone& bone = made.bones.emplace_back();
    bone.name = seeds[i].name;
    bone.seed = seeds[i].point;
    bone.seed_hu = double(ct.voxels[index_in(ct, voxel_at(ct, seeds[i].point))]);
    bone.label = label_of[parts.regions.root(of_seeds[i])] = static_cast<std::uint8_t>(i + 1);
  }
  std::size_t i = 0;
  parts.work.bone.each([&](const Vector3i& at) {
    if (const std::uint32_t region = parts.regions.labels[i++]; region != 0)
      made.labels[index_in(ct, at + parts.work.first)] = label_of[parts.regions.root(region - 1)];
  });
  measure_bones(made);
  return made;
}

/// How much bone without a seed hangs together with each bone.
void add_left_out(Segmentation& made, Watershed& regions, const std::vector<std::uint8_t>& label_of,
                  const std::vector<std::size_t>& sizes, double voxel_cm3) {
  Watershed all{{}, regions.joined, regions.depths, {}};
  for (const Neck& neck : regions.necks) all.join(neck.a, neck.b);
  std::vector<double> whole(sizes.size(), 0), without(sizes.size(), 0);
  std::vector<std::uint32_t> group_of(256, 0);
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    if (sizes[i] == 0) continue;  // joined to another one
    const std::uint32_t group = all.root(static_cast<std::uint32_t>(i));
    whole[group] += double(sizes[i]);
    if (label_of[i] == 0) without[group] += double(sizes[i]);
    group_of[label_of[i]] = group;
  }
  for (Bone& bone : made.bones) {
    const std::uint32_t group = group_of[bone.label];
    bone.left_out_cm3 = without[group] * voxel_cm3;
    bone.left_out_percent = 100 * without[group] / whole[group];
  }
}

std::string text_of(const Contact& contact, const std::string& name) {
  const bool no_seed = contact.with.empty();
  return fmt::format(
      "{}: meets {} over a contact of {:.1f} mm radius, {:.2f} of the smaller one's, at {}: look at the "
      "outline there{}",
      name, no_seed ? fmt::format("{:.1f} cm3 of bone without a seed", contact.with_cm3) : contact.with,
      contact.neck_mm, contact.width, text_of(contact.at),
      no_seed ? "; if it is a part of the same bone, give a neck below that" : "");
}

/// Contacts of the bones, the widest with each other one, and the doubtful ones as warnings.
template <class PointOf>
void add_contacts(Segmentation& made, Parts& parts, const std::vector<std::uint8_t>& label_of,
                  const std::vector<std::size_t>& sizes, const PointOf& point_of) {
  const double voxel_cm3 = std::abs(made.patient_from_voxel.linear().determinant()) / 1000;
  std::set<std::pair<std::uint32_t, std::uint32_t>> met;
  for (const Neck& neck : parts.regions.necks) {  // the deepest first
    auto [own, other] = std::minmax({parts.regions.root(neck.a), parts.regions.root(neck.b)});
    if (own == other || (label_of[own] == 0 && label_of[other] == 0) || !met.emplace(own, other).second)
      continue;
    if (label_of[own] == 0) std::swap(own, other);
    const auto contact_with = [&](std::uint32_t region) {
      return Contact{label_of[region] == 0 ? std::string() : made.bones[label_of[region] - 1U].name,
                     double(sizes[region]) * voxel_cm3, neck.depth * parts.unit_mm,
                     parts.regions.local_width(neck, parts.depth()), point_of(neck)};
    };
    const Contact contact = contact_with(other);
    made.bones[label_of[own] - 1U].contacts.push_back(contact);
    if (label_of[other] != 0) made.bones[label_of[other] - 1U].contacts.push_back(contact_with(own));
    if (contact.width < doubtful_contact) continue;
    const Bone& bone = made.bones[label_of[own] - 1U];
    made.warnings.push_back({Reason::bones_in_contact,
                             text_of(contact, bone.name),
                             {},
                             {{"neck_mm", contact.neck_mm},
                              {"width", contact.width},
                              {"with_cm3", contact.with_cm3},
                              {"left_out_percent", bone.left_out_percent}}});
  }
}

/// Warns of bones that are nearly two.
template <class PointOf>
void add_narrow_joins(Segmentation& made, Parts& parts, const std::vector<std::uint32_t>& of_seeds,
                      const std::vector<Join>& narrowest, double neck, const PointOf& point_of) {
  for (std::size_t k = 0; k < of_seeds.size(); ++k) {
    const Join& join = narrowest[parts.regions.root(of_seeds[k])];
    if (join.width >= neck + doubtful_join) continue;
    const double neck_mm = join.neck.depth * parts.unit_mm;
    made.warnings.push_back(
        {Reason::bones_in_contact,
         fmt::format("{}: is narrow at {}: a neck of {:.1f} mm radius, {:.2f} of the smaller part's: if two "
                     "bones meet there, give each a seed, or a neck above that",
                     made.bones[k].name, text_of(point_of(join.neck)), neck_mm, join.width),
         {},
         {{"neck_mm", neck_mm}, {"width", join.width}}});
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
    Parts parts = parts_of(ct, options, progress);
    check_on_bone(ct, parts, seeds, options.neck);
    const auto of_seeds = regions_of(ct, parts.work, seeds, parts.regions);
    const auto narrowest = join_regions(parts.regions, parts.depth(), of_seeds, options.neck, parts.small);
    progress.begin("label");
    std::vector<std::uint8_t> label_of(parts.regions.joined.size(), 0);
    Segmentation made = labelled(ct, parts, seeds, of_seeds, label_of);
    check_sizes(ct, parts, made);
    const auto point_of = [&](const Neck& neck) -> Vector3d {
      return ct.patient_from_voxel *
             (voxel_of(neck.at, parts.work.bone.size) + parts.work.first).cast<double>();
    };
    const std::vector<std::size_t> sizes = sizes_of(parts.regions);
    add_left_out(made, parts.regions, label_of, sizes,
                 std::abs(ct.patient_from_voxel.linear().determinant()) / 1000);
    add_contacts(made, parts, label_of, sizes, point_of);
    add_narrow_joins(made, parts, of_seeds, narrowest, options.neck, point_of);
    return made;
  });
}

}  // namespace helicarm::segmentation
