// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/match.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "helicarm/track/body_pose.h"

namespace helicarm::migration {
namespace {

constexpr std::size_t most_triples =
    40;  // of a segment, by area: enough where a third of its markers is hidden

struct Triple {
  std::array<std::size_t, 3> of;
  double area;
};

/// The segment's triples, the largest first.
std::vector<Triple> triples_of(const std::vector<Marker>& markers) {
  std::vector<Triple> triples;
  for (std::size_t i = 0; i < markers.size(); ++i)
    for (std::size_t j = i + 1; j < markers.size(); ++j)
      for (std::size_t k = j + 1; k < markers.size(); ++k)
        triples.push_back({{i, j, k},
                           (markers[j].place - markers[i].place)
                               .cross(Eigen::Vector3d(markers[k].place - markers[i].place))
                               .norm()});
  std::ranges::stable_sort(triples, std::greater{}, &Triple::area);
  if (triples.size() > most_triples) triples.resize(most_triples);
  return triples;
}

/// Every marker of the segment with the nearest of the second that is within reach of its place, one to one.
Match nearest(const std::vector<Marker>& first, const std::vector<Marker>& second,
              const geometry::RigidTransform& pose, double reach_mm) {
  struct Candidate {
    double distance;
    std::size_t i, k;
  };
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < first.size(); ++i)
    for (std::size_t k = 0; k < second.size(); ++k)
      if (const double distance = (pose * first[i].place - second[k].place).norm(); distance < reach_mm)
        candidates.push_back({distance, i, k});
  std::ranges::sort(candidates, {}, &Candidate::distance);
  std::vector<std::optional<std::size_t>> of(first.size());
  std::vector<char> taken(second.size());
  for (const Candidate& candidate : candidates)
    if (!of[candidate.i] && !taken[candidate.k]) of[candidate.i] = candidate.k, taken[candidate.k] = 1;
  Match match;
  for (std::size_t i = 0; i < first.size(); ++i)
    if (of[i]) match.first.push_back(i), match.second.push_back(*of[i]);
  return match;
}

struct Fitted {
  Match match;
  geometry::RigidTransform pose;
  double chi2 = 0;
};

/// The pose of a match, and its squares by the markers' errors.
Fitted fitted(Match match, const std::vector<Marker>& first, const std::vector<Marker>& second) {
  constexpr double usual_mm = 0.1;  // of a marker in its segment between the examinations, and of its image
  std::vector<Eigen::Vector3d> from, to;
  for (std::size_t n = 0; n < match.first.size(); ++n)
    from.push_back(first[match.first[n]].place), to.push_back(second[match.second[n]].place);
  Fitted fitted{std::move(match), geometry::absolute_pose(from, to), 0};
  for (std::size_t n = 0; n < from.size(); ++n) {
    double variance = usual_mm * usual_mm;
    for (const Marker* marker : {&first[fitted.match.first[n]], &second[fitted.match.second[n]]})
      if (marker->covariance) variance += marker->covariance->trace() / 3;
    fitted.chi2 += (fitted.pose * from[n] - to[n]).squaredNorm() / variance;
  }
  return fitted;
}

Expected<Match> enough(const std::string& what, Match match) {
  if (match.first.size() < 3)
    return fail(Reason::too_few_fiducials,
                fmt::format("{}: {} of its markers are found in the second examination, three are needed",
                            what, match.first.size()));
  return match;
}

}  // namespace

Expected<Match> match_by_geometry(const std::string& what, const std::vector<Marker>& first,
                                  const std::vector<Marker>& second, double reach_mm) {
  std::map<std::vector<std::size_t>, Fitted> found;  // by assignment
  const auto distance = [](const Marker& a, const Marker& b) { return (a.place - b.place).norm(); };
  for (const Triple& triple : triples_of(first)) {
    const auto [i, j, k] = triple.of;
    const double ij = distance(first[i], first[j]), ik = distance(first[i], first[k]),
                 jk = distance(first[j], first[k]);
    for (std::size_t a = 0; a < second.size(); ++a)
      for (std::size_t b = 0; b < second.size(); ++b) {
        if (b == a || std::abs(distance(second[a], second[b]) - ij) > reach_mm) continue;
        for (std::size_t c = 0; c < second.size(); ++c) {
          if (c == a || c == b || std::abs(distance(second[a], second[c]) - ik) > reach_mm ||
              std::abs(distance(second[b], second[c]) - jk) > reach_mm)
            continue;
          Fitted now = fitted({{i, j, k}, {a, b, c}}, first, second);
          // Markers within reach of the triple's pose improve it, which may bring others within reach.
          for (int round = 0; round < 3; ++round) {
            Match next = nearest(first, second, now.pose, reach_mm);
            if (next.first.size() < 3) break;
            const bool is_same = next.first == now.match.first && next.second == now.match.second;
            now = fitted(std::move(next), first, second);
            if (is_same) break;
          }
          if (now.match.first.size() < 3) continue;
          std::vector<std::size_t> key(first.size(), second.size());
          for (std::size_t n = 0; n < now.match.first.size(); ++n)
            key[now.match.first[n]] = now.match.second[n];
          found.try_emplace(std::move(key), std::move(now));
        }
      }
  }
  const Fitted *best = nullptr, *other = nullptr;
  const auto is_better = [](const Fitted& a, const Fitted* b) {
    return !b || a.match.first.size() > b->match.first.size() ||
           (a.match.first.size() == b->match.first.size() && a.chi2 < b->chi2);
  };
  for (const auto& [key, each] : found)
    if (is_better(each, best))
      other = best, best = &each;
    else if (is_better(each, other))
      other = &each;
  if (!best) return enough(what, {});
  // exp(-8): the likelihood ratio at which the worse one is out of the question.
  constexpr double chi2_apart = 16;
  if (other && other->match.first.size() == best->match.first.size() && other->chi2 - best->chi2 < chi2_apart)
    return fail(Reason::ambiguous_labels,
                fmt::format("{}: its markers are congruent: {} of them correspond in two ways that fit about "
                            "as well; name them alike in both examinations and match them by name",
                            what, best->match.first.size()),
                {{"chi2", best->chi2}, {"chi2_other", other->chi2}});
  return best->match;
}

Expected<Match> match_by_name(const std::string& what, const std::vector<Marker>& first,
                              const std::vector<Marker>& second) {
  Match match;
  for (std::size_t i = 0; i < first.size(); ++i)
    if (const auto found = std::ranges::find(second, first[i].name, &Marker::name); found != second.end()) {
      match.first.push_back(i);
      match.second.push_back(std::size_t(found - second.begin()));
    }
  return enough(what, std::move(match));
}

}  // namespace helicarm::migration
