// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/segment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/segmentation/bones.h"
#include "helicarm/segmentation/contacts.h"
#include "helicarm/volume/axis_order.h"
#include "helicarm/volume/hounsfield.h"

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr std::size_t least_voxels = 50;  // of a bone; noise makes some in cancellous bone near the threshold

Vector3i voxel_at(const volume::Volume& ct, const Vector3d& point) {
  return ((ct.patient_from_voxel.inverse() * point).array() + 0.5).floor().cast<int>();
}

bool holds(const volume::Volume& ct, const Vector3d& point) {
  const Vector3d at = ct.patient_from_voxel.inverse() * point;
  return (at.array() >= -0.5).all() && (at.array() < ct.size.cast<double>().array() - 0.5).all();
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

bool on_bone(const Work& work, const Vector3i& voxel) {
  const Vector3i at = voxel - work.first;
  return work.bone.has(at) && work.bone.values[work.bone.index(at)] != empty;
}

[[noreturn]] void refuse_one_bone(const Seed& seed, const Seed& other) {
  throw BadInput(
      {Reason::seeds_in_one_bone,
       fmt::format(
           "the seeds {} {} and {} {} are on one bone: between them it is never narrower "
           "than {:g} of its radius; leave one out, or raise the threshold where two "
           "bones have grown together in the CT, or a smaller gap (--gap) where a joint's space is narrow",
           other.name, text_of(other.point), seed.name, text_of(seed.point), surely_one),
       {},
       {{"distance_mm", (other.point - seed.point).norm()}}});
}

/// The regions of the seeds, which must differ.
std::vector<std::uint32_t> regions_of(const volume::Volume& ct, const Work& work, std::span<const Seed> seeds,
                                      Watershed& regions) {
  std::vector<std::uint32_t> found;
  for (const Seed& seed : seeds) {
    const std::uint32_t region = regions.region_at(work.bone.index(voxel_at(ct, seed.point) - work.first));
    if (const auto same = std::ranges::find(found, region); same != found.end())
      refuse_one_bone(seed, seeds[std::size_t(same - found.begin())]);
    found.push_back(region);
  }
  return found;
}

/// Refuses seeds whose bones, once joined, meet over a contact as wide as the bone beside it: the slow waist
/// of one.
void check_apart(Parts& parts, std::span<const Seed> seeds, const std::vector<std::uint32_t>& of_seeds) {
  const auto seed_of = [&](std::uint32_t region) {
    return std::size_t(
        std::ranges::find(of_seeds, region, [&](std::uint32_t of) { return parts.regions.root(of); }) -
        of_seeds.begin());
  };
  for (const Neck& neck : parts.regions.necks) {
    const std::size_t a = seed_of(parts.regions.root(neck.a)), b = seed_of(parts.regions.root(neck.b));
    if (a != b && std::max(a, b) < seeds.size() &&
        parts.regions.local_width(neck, parts.depth()) >= surely_one)
      refuse_one_bone(seeds[std::max(a, b)], seeds[std::min(a, b)]);
  }
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

/// Where values are hardly Hounsfield units the threshold says nothing, and no seed helps; else empty.
std::string other_unit(const volume::Volume& ct) {
  const auto warnings = volume::check_hounsfield(ct, "the CT");
  if (!warnings) return "; " + warnings.error().message;
  return warnings->empty() ? "" : "; " + warnings->front().message;
}

/// Refuses seeds that are on no bone.
void check_on_bone(const volume::Volume& ct, Parts& parts, std::span<const Seed> seeds, double neck) {
  for (const Seed& seed : seeds) {
    const Vector3i voxel = voxel_at(ct, seed.point);
    if (on_bone(parts.work, voxel)) continue;
    join_regions(parts, {}, neck);
    const Vector3d as_ras = seed.point.cwiseProduct(Vector3d(-1, -1, 1));
    const bool is_ras = holds(ct, as_ras) && on_bone(parts.work, voxel_at(ct, as_ras));
    const double hu = double(ct.voxels[index_in(ct, voxel)]);
    std::map<std::string, double> figures{{"hu", hu}, {"threshold_hu", parts.threshold}};
    const std::string nearest = nearest_bone(ct, parts, seed.point, figures);
    throw BadInput({Reason::seed_off_bone,
                    fmt::format("{}: the seed {} has {:.0f} HU, bone begins at {:g}; {}: click on the bone, "
                                "or lower the threshold{}{}",
                                seed.name, text_of(seed.point), hu, parts.threshold, nearest,
                                is_ras ? "; as R, A, S the seed lies on bone" : "", other_unit(ct)),
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
    throw BadInput({Reason::seed_off_bone,
                    fmt::format("{}: the seed {} lies on a speck of {} voxels, a bone has {} or more; {}: "
                                "click on the bone, or lower the threshold ({:g} HU){}",
                                bone.name, text_of(*bone.seed), bone.voxels, least_voxels, nearest,
                                parts.threshold, other_unit(ct)),
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

Segmentation segmented(const volume::Volume& ct, std::span<const Seed> seeds, const SegmentOptions& options,
                       const pipeline::Progress& progress) {
  check_seeds(ct, seeds);
  Parts parts = parts_of(ct, options, progress);
  check_on_bone(ct, parts, seeds, options.neck);
  const auto of_seeds = regions_of(ct, parts.work, seeds, parts.regions);
  const auto narrowest = join_regions(parts, of_seeds, options.neck);
  check_apart(parts, seeds, of_seeds);
  progress.begin("label");
  std::vector<std::uint8_t> label_of(parts.regions.joined.size(), 0);
  Segmentation made = labelled(ct, parts, seeds, of_seeds, label_of);
  check_sizes(ct, parts, made);
  const std::vector<std::size_t> sizes = sizes_of(parts.regions);
  add_left_out(made, parts.regions, label_of, sizes);
  add_contacts(made, parts, label_of, sizes);
  add_narrow_joins(made, parts, of_seeds, narrowest, options.neck);
  add_held_by_gaps(ct, made);
  return made;
}

void put_onto_grid(Segmentation& made, const volume::Volume& ct, const volume::AxisOrder& order) {
  made.labels = volume::reordered(made.labels, made.size, order, ct.size);
  made.size = ct.size;
  made.patient_from_voxel = ct.patient_from_voxel;
  for (Bone& bone : made.bones) {
    const Vector3i a = order.turn * bone.low + order.first, b = order.turn * bone.high + order.first;
    bone.low = a.cwiseMin(b), bone.high = a.cwiseMax(b);
  }
}

}  // namespace

Expected<Segmentation> segment(const volume::Volume& ct, std::span<const Seed> seeds,
                               const SegmentOptions& options, const pipeline::Progress& progress) {
  return guarded([&] {
    value_or_throw(check_fields<SegmentOptions>(segment_fields, options, "segment"));
    // The order of memory decides between equal depths: let it be the patient's, not the file's.
    const volume::AxisOrder order = volume::order_to_patient(ct);
    if (order.is_same()) return segmented(ct, seeds, options, progress);
    const Vector3i size = order.turn.cwiseAbs() * ct.size;
    Segmentation made = segmented({size,
                                   volume::reordered(ct.voxels, ct.size, order, size),
                                   ct.patient_from_voxel * order.inverse().affine(),
                                   {}},
                                  seeds, options, progress);
    put_onto_grid(made, ct, order.inverse());
    return made;
  });
}

}  // namespace helicarm::segmentation
