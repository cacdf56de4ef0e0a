// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/contacts.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>

#include <Eigen/LU>
#include <fmt/format.h>

namespace helicarm::segmentation {
namespace {

// A contact is worth a look from here up to where it joins, and a bone's own neck from there so far on.
constexpr double doubtful_contact = 0.45, doubtful_join = 0.1;

Eigen::Vector3d place_of(const Neck& neck, const Segmentation& made, const Parts& parts) {
  return made.patient_from_voxel *
         (voxel_of(neck.at, parts.work.bone.size) + parts.work.first).cast<double>();
}

std::string contact_text(const Contact& contact, const std::string& name) {
  const bool no_seed = contact.with.empty();
  return fmt::format(
      "{}: meets {} over a contact of {:.1f} mm radius, {:.2f} of the smaller one's, at {}: look at the "
      "outline there{}",
      name, no_seed ? fmt::format("{:.1f} cm3 of bone without a seed", contact.with_cm3) : contact.with,
      contact.neck_mm, contact.width, text_of(contact.at),
      no_seed ? "; if it is a part of the same bone, give a neck below that" : "");
}

}  // namespace

void add_left_out(Segmentation& made, Watershed& regions, const std::vector<std::uint8_t>& label_of,
                  const std::vector<std::size_t>& sizes) {
  const double voxel_cm3 = std::abs(made.patient_from_voxel.linear().determinant()) / 1000;
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

void add_contacts(Segmentation& made, Parts& parts, const std::vector<std::uint8_t>& label_of,
                  const std::vector<std::size_t>& sizes) {
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
                     parts.regions.local_width(neck, parts.depth()), place_of(neck, made, parts)};
    };
    const Contact contact = contact_with(other);
    made.bones[label_of[own] - 1U].contacts.push_back(contact);
    if (label_of[other] != 0) made.bones[label_of[other] - 1U].contacts.push_back(contact_with(own));
    if (contact.width < doubtful_contact) continue;
    const Bone& bone = made.bones[label_of[own] - 1U];
    made.warnings.push_back({Reason::bones_in_contact,
                             contact_text(contact, bone.name),
                             {},
                             {{"neck_mm", contact.neck_mm},
                              {"width", contact.width},
                              {"with_cm3", contact.with_cm3},
                              {"left_out_percent", bone.left_out_percent}}});
  }
}

void add_narrow_joins(Segmentation& made, Parts& parts, const std::vector<std::uint32_t>& of_seeds,
                      const std::vector<Join>& narrowest, double neck) {
  for (std::size_t k = 0; k < of_seeds.size(); ++k) {
    const Join& join = narrowest[parts.regions.root(of_seeds[k])];
    if (join.width >= neck + doubtful_join) continue;
    const double neck_mm = join.neck.depth * parts.unit_mm;
    made.warnings.push_back(
        {Reason::bones_in_contact,
         fmt::format("{}: is narrow at {}: a neck of {:.1f} mm radius, {:.2f} of the smaller part's: if two "
                     "bones meet there, give each a seed, or a neck above that",
                     made.bones[k].name, text_of(place_of(join.neck, made, parts)), neck_mm, join.width),
         {},
         {{"neck_mm", neck_mm}, {"width", join.width}}});
  }
}

namespace {

/// Sizes of the pieces of what reaches the threshold in each bone, by its label, in voxels that touch, also
/// by corners.
std::map<std::uint8_t, std::vector<std::size_t>> dense_pieces(const volume::Volume& ct,
                                                              const Segmentation& made) {
  const Eigen::Vector3i& size = made.size;
  std::vector<bool> seen(made.labels.size(), false);
  const auto is_dense = [&](std::size_t i) {
    return made.labels[i] != 0 && double(ct.voxels[i]) >= made.threshold_hu;
  };
  std::map<std::uint8_t, std::vector<std::size_t>> sizes;
  std::vector<std::size_t> open;
  for (std::size_t first = 0; first < made.labels.size(); ++first) {
    if (seen[first] || !is_dense(first)) continue;
    std::size_t count = 0;
    seen[first] = true;
    open.assign(1, first);
    while (!open.empty()) {
      const Eigen::Vector3i at = voxel_of(std::uint32_t(open.back()), size);
      open.pop_back();
      ++count;
      const Eigen::Vector3i low = (at.array() - 1).max(0), high = (at.array() + 1).min(size.array() - 1);
      for (int z = low.z(); z <= high.z(); ++z)
        for (int y = low.y(); y <= high.y(); ++y)
          for (int x = low.x(); x <= high.x(); ++x) {
            const std::size_t next = index_in(ct, {x, y, z});
            if (seen[next] || made.labels[next] != made.labels[first] || !is_dense(next)) continue;
            seen[next] = true;
            open.push_back(next);
          }
    }
    sizes[made.labels[first]].push_back(count);
  }
  for (auto& [label, of_bone] : sizes) std::ranges::sort(of_bone, std::greater());
  return sizes;
}

}  // namespace

void add_held_by_gaps(const volume::Volume& ct, Segmentation& made) {
  constexpr double least_part = 0.05, least_cm3 = 0.5;  // of what is said
  const double voxel_cm3 = std::abs(made.patient_from_voxel.linear().determinant()) / 1000;
  auto all_pieces = dense_pieces(ct, made);
  for (const Bone& bone : made.bones) {
    const std::vector<std::size_t>& pieces = all_pieces[bone.label];
    if (pieces.size() < 2) continue;
    const double first = double(pieces[0]) * voxel_cm3, second = double(pieces[1]) * voxel_cm3;
    if (second < std::max(least_cm3, least_part * first)) continue;
    made.warnings.push_back(
        {Reason::bones_in_contact,
         fmt::format(
             "{}: bone of {:.1f} cm3 and of {:.1f} cm3 in it do not touch; only closed gaps and filled "
             "cavities hold them together: if these are two bones, as where a joint's space is narrow, "
             "give each a seed, or a smaller gap (--gap, half of the width that is closed)",
             bone.name, first, second),
         {},
         {{"first_cm3", first}, {"second_cm3", second}}});
  }
}

}  // namespace helicarm::segmentation
