// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/exchanges.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/track/body_shape.h"

namespace helicarm::track {
namespace {

constexpr double suspect_mm = 0.5;  // rms of a body's markers about its geometry
constexpr double cut_mm = 5;        // of one marker

/// Square sum of a frame's deviations from the bodies' geometry, with what a marker's rays miss each other
/// by.
double misfit_of(const SequenceData& work, const std::vector<Shape>& shapes, std::size_t f) {
  double sum = 0;
  for (std::size_t b = 0; b < shapes.size(); ++b) {
    const BodyPlan& plan = work.the_case.bodies[b];
    const auto pose = pose_from(work, plan, shapes[b].in_body, f, std::vector<char>(plan.markers.size(), 1));
    for (std::size_t i = 0; i < plan.markers.size(); ++i) {
      const auto& point = work.points[f][plan.markers[i]];
      if (!point || !pose || !shapes[b].in_body[i]) continue;
      sum += std::min(cut_mm * cut_mm, (point->place - *pose * *shapes[b].in_body[i]).squaredNorm() +
                                           point->ray_gap_mm * point->ray_gap_mm);
    }
  }
  return sum;
}

void exchange(SequenceData& work, std::size_t f, std::size_t first, std::size_t second, std::size_t view) {
  for (std::size_t k = 0; k < work.views; ++k)
    if (view == work.views || view == k) std::swap(work.sights[f][first][k], work.sights[f][second][k]);
  for (const std::size_t m : {first, second}) {
    const auto seen = work.seen(f, m);
    work.points[f][m] = seen.size() >= 2 ? sighted_point(seen) : std::nullopt;
  }
}

struct Exchange {
  std::size_t first = 0, second = 0, view = 0;  // `views`: in all
};

/// The exchange of two markers that explains a frame, where one does.
std::optional<Exchange> exchange_in(SequenceData& work, const std::vector<Shape>& shapes, std::size_t f) {
  constexpr double explained = 0.1;
  const double now = misfit_of(work, shapes, f);
  if (now < suspect_mm * suspect_mm) return std::nullopt;
  double least = explained * now;
  std::optional<Exchange> best;
  for (std::size_t i = 0; i < work.markers; ++i)
    for (std::size_t k = i + 1; k < work.markers; ++k) {
      if (!work.points[f][i] || !work.points[f][k]) continue;
      for (std::size_t view = 0; view <= work.views; ++view) {
        exchange(work, f, i, k, view);
        const bool is_whole = work.points[f][i] && work.points[f][k];
        const double there = is_whole ? misfit_of(work, shapes, f) : least;
        exchange(work, f, i, k, view);
        if (there < least) least = there, best = Exchange{i, k, view};
      }
    }
  return best;
}

/// The names of a body's markers are those of the first frame: where most frames have two exchanged, so has
/// the geometry learnt from them.
void take_first_names(SequenceData& work, std::vector<Shape>& shapes) {
  for (std::size_t round = 0; round < work.markers; ++round) {
    const auto found = exchange_in(work, shapes, 0);
    if (!found || found->view != work.views) return;
    bool is_taken = false;
    for (std::size_t b = 0; b < shapes.size(); ++b) {
      const BodyPlan& plan = work.the_case.bodies[b];
      const auto first = std::ranges::find(plan.markers, found->first),
                 second = std::ranges::find(plan.markers, found->second);
      if (first == plan.markers.end() || second == plan.markers.end() || !plan.geometry.empty()) continue;
      std::swap(shapes[b].in_body[std::size_t(first - plan.markers.begin())],
                shapes[b].in_body[std::size_t(second - plan.markers.begin())]);
      is_taken = true;
    }
    if (!is_taken) return;
  }
}

/// How far a body's markers are from one shape, rms, in all frames and in the first.
struct Rigidity {
  double rms_mm = 0, first_mm = 0;
};

Rigidity rigidity_of(const SequenceData& work, const BodyPlan& plan) {
  const Shape shape = shape_of(work, plan, std::vector<char>(plan.markers.size(), 1));
  double squares = 0, first = 0;
  int count = 0, of_first = 0;
  for (std::size_t f = 0; f < work.frames; ++f)
    for (std::size_t i = 0; i < plan.markers.size(); ++i)
      if (const auto& point = work.points[f][plan.markers[i]]; point && shape.poses[f] && shape.in_body[i]) {
        squares +=
            std::min(cut_mm * cut_mm, (point->place - *shape.poses[f] * *shape.in_body[i]).squaredNorm());
        ++count;
        if (f == 0) first = squares, of_first = count;
      }
  return {std::sqrt(squares / std::max(1, count)), std::sqrt(first / std::max(1, of_first))};
}

}  // namespace

void repair_exchanges(SequenceData& work, Sequence& sequence) {
  std::vector<Shape> shapes;
  for (const BodyPlan& plan : work.the_case.bodies)
    shapes.push_back(shape_of(work, plan, std::vector<char>(plan.markers.size(), 1)));
  take_first_names(work, shapes);
  for (std::size_t f = 0; f < work.frames; ++f)
    while (const auto found = exchange_in(work, shapes, f)) {
      exchange(work, f, found->first, found->second, found->view);
      auto& images = sequence.images[f];
      for (std::size_t k = 0; k < work.views; ++k)
        if (found->view == work.views || found->view == k)
          std::swap(images[found->first * work.views + k], images[found->second * work.views + k]);
      ++sequence.repaired;
      const bool is_everywhere = found->view == work.views;
      sequence.warnings.push_back(
          {Reason::markers_swapped,
           fmt::format("frame {}: the images of \"{}\" and \"{}\" were exchanged{}, against the geometry of "
                       "their bodies: they are exchanged back",
                       sequence.frames[f], work.the_case.markers[found->first],
                       work.the_case.markers[found->second], is_everywhere ? " in all views" : ""),
           is_everywhere ? std::string() : work.the_case.views[found->view].images.name,
           {{"frame", double(sequence.frames[f])}}});
    }
}

std::optional<ExchangedNames> exchanged_names(const SequenceData& work) {
  constexpr double suspect_rms_mm = 0.1, explained_share = 0.15;  // of the mean squares
  constexpr std::size_t fewest = 4;  // of a body's markers: three fit many shapes
  const auto& plans = work.the_case.bodies;
  std::vector<Rigidity> now;
  for (const BodyPlan& plan : plans)
    now.push_back(plan.markers.size() < fewest ? Rigidity{} : rigidity_of(work, plan));
  const auto is_explained = [](const Rigidity& before, const Rigidity& after) {
    // In the first frame too, whose discs lie at their picks: else others were followed later.
    return after.rms_mm * after.rms_mm < explained_share * before.rms_mm * before.rms_mm &&
           after.first_mm < before.first_mm;
  };
  std::optional<ExchangedNames> best;
  double least = 0;
  for (std::size_t a = 0; a < plans.size(); ++a)
    for (std::size_t b = a + 1; b < plans.size(); ++b) {
      if (now[a].rms_mm < suspect_rms_mm || now[b].rms_mm < suspect_rms_mm) continue;
      for (std::size_t i = 0; i < plans[a].markers.size(); ++i)
        for (std::size_t k = 0; k < plans[b].markers.size(); ++k) {
          BodyPlan first = plans[a], second = plans[b];
          std::swap(first.markers[i], second.markers[k]);
          const Rigidity of_first = rigidity_of(work, first);
          if (!is_explained(now[a], of_first)) continue;
          const Rigidity of_second = rigidity_of(work, second);
          if (!is_explained(now[b], of_second) || (best && of_first.rms_mm + of_second.rms_mm > least))
            continue;
          const std::size_t one = plans[a].markers[i], other = plans[b].markers[k];
          least = of_first.rms_mm + of_second.rms_mm;
          best = {
              one,
              other,
              {Reason::markers_swapped,
               fmt::format("\"{}\" of the body \"{}\" and \"{}\" of \"{}\" have each other's names in all "
                           "frames: their markers move against each other by {:.2f} and {:.2f} mm rms, with "
                           "the names exchanged by {:.2f} and {:.2f} mm: correct the names",
                           work.the_case.markers[one], plans[a].name, work.the_case.markers[other],
                           plans[b].name, now[a].rms_mm, now[b].rms_mm, of_first.rms_mm, of_second.rms_mm),
               {},
               {{"rms_mm", std::max(now[a].rms_mm, now[b].rms_mm)},
                {"exchanged_mm", std::max(of_first.rms_mm, of_second.rms_mm)}}}};
        }
    }
  return best;
}

}  // namespace helicarm::track
