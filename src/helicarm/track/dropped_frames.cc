// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/dropped_frames.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <span>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/track/delays.h"

namespace helicarm::track {
namespace {

constexpr double least_jump = 0.5, clear_sigmas = 6;  // frames; standard deviations
constexpr std::size_t block_frames = 5;               // the shortest part that is seen
constexpr double inlier_chi2 = 16;

/// Frames with one delay; gaps [begin, end) of the view's.
struct StepPart {
  std::size_t begin, end;
  std::size_t first_frame;
  double delay = 0, variance = 0;
};

/// By all gaps of the part, whose errors last for each marker.
void estimate_part(StepPart& part, const std::vector<RayGap>& gaps) {
  const auto of = std::span(gaps).subspan(part.begin, part.end - part.begin);
  const auto [delay, scale] = delay_of(of);
  part.delay = delay.frames;
  std::map<std::size_t, double> scores;
  double information = 0;
  for (const RayGap& each : of) {
    const double left = each.gap - part.delay * each.speed;
    if (left * left > inlier_chi2 * scale * each.variance) continue;
    information += each.speed * each.speed / each.variance;
    scores[each.marker] += left * each.speed / each.variance;
  }
  constexpr std::size_t fewest_markers = 3;
  part.variance = std::numeric_limits<double>::infinity();
  if (scores.size() < fewest_markers || !(information > 0)) return;
  double squares = 0;
  for (const auto& [marker, score] : scores) squares += score * score;
  const double markers = double(scores.size());
  part.variance =
      std::max(delay.sigma * delay.sigma, squares * markers / (markers - 1) / (information * information));
}

double clearness(const StepPart& a, const StepPart& b) {
  const double jump = std::abs(b.delay - a.delay);
  return jump < least_jump ? 0 : jump / std::sqrt(a.variance + b.variance);
}

/// Joins neighbours until each differs clearly from the next.
template <class Join>
void join_alike(std::vector<StepPart>& parts, Join join) {
  while (parts.size() > 1) {
    std::size_t most_alike = 0;
    for (std::size_t i = 1; i + 1 < parts.size(); ++i)
      if (clearness(parts[i], parts[i + 1]) < clearness(parts[most_alike], parts[most_alike + 1]))
        most_alike = i;
    if (clearness(parts[most_alike], parts[most_alike + 1]) > clear_sigmas) return;
    join(parts[most_alike], parts[most_alike + 1]);
    parts.erase(parts.begin() + std::ptrdiff_t(most_alike) + 1);
  }
}

std::vector<StepPart> blocks_of(const std::vector<RayGap>& gaps) {
  std::vector<StepPart> blocks;
  for (std::size_t i = 0; i < gaps.size(); ++i) {
    if (blocks.empty() || gaps[i].frame >= blocks.back().first_frame + block_frames)
      blocks.push_back({i, i, gaps[i].frame});
    blocks.back().end = i + 1;
  }
  for (StepPart& block : blocks) estimate_part(block, gaps);
  return blocks;
}

/// The frame between two parts that their gaps tell best.
void place_border(StepPart& before, StepPart& after, const std::vector<RayGap>& gaps, double scale) {
  const std::size_t reach = 2 * block_frames, border = after.first_frame;
  double cost = 0, least = 0;
  std::size_t best = before.end;
  bool is_begun = false;
  for (std::size_t i = before.begin; i < after.end; ++i) {
    if (gaps[i].frame + reach < border || gaps[i].frame >= border + reach) continue;
    const bool is_new = i == before.begin || gaps[i].frame != gaps[i - 1].frame;
    if (is_new && i > before.begin && (!is_begun || cost < least)) least = cost, best = i, is_begun = true;
    const auto misfit = [&](double delay) {
      const double left = gaps[i].gap - delay * gaps[i].speed;
      return std::min(inlier_chi2, left * left / (scale * gaps[i].variance));
    };
    cost += misfit(before.delay) - misfit(after.delay);
  }
  before.end = after.begin = best;
  after.first_frame = gaps[best].frame;
}

std::vector<StepPart> alike_parts(const std::vector<RayGap>& gaps) {
  std::vector<StepPart> parts = blocks_of(gaps);
  join_alike(parts, [](StepPart& a, const StepPart& b) {
    a.end = b.end;
    if (std::isinf(b.variance)) return;
    if (std::isinf(a.variance)) {
      a.delay = b.delay, a.variance = b.variance;
      return;
    }
    const double share = a.variance / (a.variance + b.variance);
    a.delay += share * (b.delay - a.delay);
    a.variance *= 1 - share;
  });
  if (parts.size() < 2) return parts;
  for (StepPart& part : parts) estimate_part(part, gaps);
  std::vector<double> ratios;
  for (const StepPart& part : parts)
    for (std::size_t i = part.begin; i < part.end; ++i)
      ratios.push_back(std::pow(gaps[i].gap - part.delay * gaps[i].speed, 2) / gaps[i].variance);
  const double scale = std::max(1.0, median(std::move(ratios)) / median_of_chi2);
  for (std::size_t i = 0; i + 1 < parts.size(); ++i) place_border(parts[i], parts[i + 1], gaps, scale);
  std::erase_if(parts, [](const StepPart& part) { return part.begin == part.end; });
  for (StepPart& part : parts) estimate_part(part, gaps);
  join_alike(parts, [&](StepPart& a, const StepPart& b) {
    a.end = b.end;
    estimate_part(a, gaps);
  });
  return parts;
}

/// Ray gaps less what the parts' delays leave of them for each marker in the median: errors of cameras or
/// texture.
std::vector<RayGap> without_lasting(std::vector<RayGap> gaps, const std::vector<StepPart>& parts) {
  std::map<std::size_t, std::vector<double>> of_marker;
  for (const StepPart& part : parts)
    for (std::size_t i = part.begin; i < part.end; ++i)
      of_marker[gaps[i].marker].push_back(gaps[i].gap - part.delay * gaps[i].speed);
  std::map<std::size_t, double> lasting;
  for (auto& [marker, values] : of_marker) lasting[marker] = median(std::move(values));
  for (RayGap& each : gaps) each.gap -= lasting[each.marker];
  return gaps;
}

std::vector<StepPart> parts_of(const std::vector<RayGap>& gaps) {
  constexpr int rounds = 3;  // delays and lasting errors in turn
  std::vector<StepPart> parts = alike_parts(gaps);
  for (int round = 0; round < rounds; ++round) parts = alike_parts(without_lasting(gaps, parts));
  return parts;
}

/// The view's images of frames [begin, end) to those that are `later`.
void move_images(SequenceData& work, std::size_t view, std::size_t begin, std::size_t end,
                 std::ptrdiff_t later) {
  const auto seen = work.sights;
  for (std::size_t f = begin; f < end; ++f) {
    const std::ptrdiff_t from = std::ptrdiff_t(f) - later;
    const bool is_there = from >= std::ptrdiff_t(begin) && from < std::ptrdiff_t(end);
    for (std::size_t m = 0; m < work.markers; ++m)
      work.sights[f][m][view] = is_there ? seen[std::size_t(from)][m][view] : std::nullopt;
  }
}

}  // namespace

void repair_dropped_frames(SequenceData& work, Sequence& sequence) {
  constexpr double whole_within = 0.3;
  if (work.frames < 2 * block_frames) return;
  const double step = work.times[1] - work.times[0];
  const std::string& first = work.the_case.views[0].images.name;
  bool is_moved = false;
  for (std::size_t k = 1; k < work.views; ++k) {
    const std::vector<StepPart> parts = parts_of(ray_gaps(work, k));
    const std::string& name = work.the_case.views[k].images.name;
    for (std::size_t i = 1; i < parts.size(); ++i) {
      const double jump = parts[i].delay - parts[i - 1].delay,
                   sigma = std::sqrt(parts[i].variance + parts[i - 1].variance),
                   all = parts[i].delay - parts[0].delay, frames = step * std::round(all / step);
      const std::size_t begin = parts[i].first_frame,
                        end = i + 1 < parts.size() ? parts[i + 1].first_frame : work.frames;
      const bool is_whole = std::abs(all - frames) < whole_within;
      if (!is_whole)
        for (std::size_t f = begin; f < end; ++f) work.refused[f] = Reason::cameras_not_in_step;
      if (is_whole && frames != 0) {
        move_images(work, k, begin, end, std::lround(frames / step));
        is_moved = true;
      }
      sequence.warnings.push_back(
          {Reason::cameras_not_in_step,
           fmt::format(
               "from about frame {} on the images of {} are of {:.2f} frames {} than before, standard "
               "deviation {:.2f}: {} dropped a frame there, or {} has one twice; {}",
               sequence.frames[begin], name, std::abs(jump), jump > 0 ? "later" : "earlier", sigma,
               jump > 0 ? name : first, jump > 0 ? first : name,
               is_whole ? "they are taken for those of the frames that they show"
                        : "the frames from there on have no pose"),
           name,
           {{"frame", double(sequence.frames[begin])}, {"jump_frames", jump}, {"sigma_frames", sigma}}});
    }
  }
  if (is_moved) locate_all(work);
}

}  // namespace helicarm::track
