// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/first_markers.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/detection/find_dots.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/marker_image.h"
#include "helicarm/track/repeated_images.h"
#include "helicarm/track/sequence_images.h"
#include "helicarm/track/sighted_point.h"
#include "helicarm/track/view_map.h"

namespace helicarm::track {
namespace {

using case_registration::FrameRange;
using Images = std::vector<xray::XrayImage>;

constexpr int most_frames = 12;
constexpr double camera_px = 0.35;  // what cameras and texture displace a disc by, standard deviation
constexpr double largest_chi2 = 9;  // of two rays that meet, one degree of freedom
constexpr double fastest_mm = 2.5;  // from frame to frame
constexpr double margin = 3;        // log likelihood: 20 to 1
constexpr double chance = 1e-3;     // of a disc of nothing in a frame's search, for the evidence of a pair
constexpr std::size_t most_discs = 600;  // of one view

struct FirstDisc {
  MarkerImage image;
  Eigen::Vector2d uv;  ///< rectified
};

/// Two discs and the marker that they may be, through the frames.
struct Match {
  std::size_t first, second;
  Eigen::Vector3d place, velocity = Eigen::Vector3d::Zero();
  double chi2;
  int seen = 1, missed = 0;
  bool is_followed = true;  ///< until it is hidden
};

class FirstFrames {
 public:
  FirstFrames(const TrackCase& the_case, const FrameRange& frames, bool as_stored = false)
      : given_(the_case),
        images_(value_or_throw(SequenceImages::open(
            std::vector<SequenceView>(the_case.views.begin(), the_case.views.end()), frames))),
        frames_(frames) {
    if (as_stored)
      for (std::size_t k = 0; k < the_case.views.size(); ++k) images_.undo_inversion(k);
    first_ = value_or_throw(images_.at(frames.first));
    check_views_differ(names_of_views(the_case), frames.first, RepeatedImages().among(frames.first, first_));
    std::vector<Sight> middles;
    for (std::size_t k = 0; k < 2; ++k) {
      const auto& pixels = first_[k].pixels;
      const Eigen::Vector2d middle((pixels.width() - 1) / 2.0, (pixels.height() - 1) / 2.0);
      const auto uv = rectified_in(the_case.views[k], middle);
      if (!uv) refuse_outside_map("picks: none; the middle of the image", the_case.views[k], middle);
      middles.push_back({&the_case.views[k].camera, *uv, 1.0});
    }
    const auto met = sighted_point(middles);
    if (!met)
      throw BadInput(Reason::views_too_close,
                     "picks: none, and the first two views see along parallel rays: pick the markers");
    middle_ = met->place;
    for (const xray::XrayImage& image : first_) {
      MarkerAppearance& appearance = appearance_.emplace_back();
      appearance.profile = detection::BallProfile(0.5, 0.8);
      appearance.options = detection::fit_options_for(image);
    }
  }

  const Images& first() const { return first_; }
  bool is_any_inverted() const {
    for (std::size_t k = 0; k < given_.views.size(); ++k)
      if (images_.is_inverted(k)) return true;
    return false;
  }
  int frame_count() const { return std::min(most_frames, frames_.count()); }
  Images frame(int index) const { return value_or_throw(images_.at(frames_.first + index * frames_.step)); }

  /// Nothing outside the view's distortion map.
  std::optional<Eigen::Vector2d> raw(std::size_t view, const Eigen::Vector3d& place) const {
    return raw_in(given_.views[view], given_.views[view].camera.project(place));
  }
  double radius_px(std::size_t view, const Eigen::Vector3d& place) const {
    const geometry::View& camera = given_.views[view].camera;
    return given_.diameter_mm / 2 * std::abs(camera.intrinsics.fy) / std::max(1.0, camera.depth(place));
  }
  double middle_radius_px(std::size_t view) const { return radius_px(view, middle_); }

  /// Clear discs of about the markers' size; `outside` counts those outside the view's distortion map.
  std::vector<FirstDisc> discs_in(std::size_t view, const xray::XrayImage& image,
                                  const std::vector<SearchWindow>& windows, int* outside = nullptr) const {
    constexpr double vaguest = 0.12;  // of the radius: texture beyond
    std::vector<FirstDisc> discs;
    for (const MarkerImage& found : find_markers(image, windows, appearance_[view]))
      if (has_marker_size(found, windows.front().radius_px) && found.contrast > 0 &&
          found.sigma_px < vaguest * windows.front().radius_px) {
        if (const auto uv = rectified_in(given_.views[view], found.uv_raw))
          discs.push_back({found, *uv});
        else if (outside)
          ++*outside;
      }
    return discs;
  }

  /// All of the first frame.
  std::vector<FirstDisc> all_discs(std::size_t view, int* outside = nullptr) const {
    const auto& pixels = first_[view].pixels;
    const double radius = middle_radius_px(view), step = std::max(40.0, 12 * radius);
    std::vector<SearchWindow> windows;
    for (double v = step / 2; v < pixels.height() + step / 2; v += step)
      for (double u = step / 2; u < pixels.width() + step / 2; u += step)
        windows.push_back({{u, v}, step / 2 + 1, radius, 0});
    std::vector<FirstDisc> discs = discs_in(view, first_[view], windows, outside);
    std::ranges::sort(discs, std::greater<>(), [](const FirstDisc& disc) { return disc.image.contrast; });
    if (discs.size() > most_discs) discs.resize(most_discs);
    return discs;
  }

  std::optional<FirstDisc> picked(const MarkerPick& pick) const {
    constexpr double click_px = 6;
    const double radius = middle_radius_px(pick.view);
    const auto found =
        picked_marker(first_[pick.view], pick.uv_raw, radius, click_px + radius, appearance_[pick.view]);
    const auto uv = found ? rectified_in(given_.views[pick.view], found->image.uv_raw) : std::nullopt;
    return uv ? std::optional(FirstDisc{found->image, *uv}) : std::nullopt;
  }

  /// Where the rays of two discs meet, if they do, as those of one marker.
  std::optional<SightedPoint> meeting(std::size_t a, const FirstDisc& first, std::size_t b,
                                      const FirstDisc& second) const {
    const auto sight = [&](std::size_t view, const FirstDisc& disc) {
      return Sight{&given_.views[view].camera, disc.uv, std::hypot(2 * disc.image.sigma_px, camera_px)};
    };
    const auto met = sighted_point(std::array{sight(a, first), sight(b, second)});
    if (!met || met->chi2 > largest_chi2) return std::nullopt;
    constexpr double largest_size = 0.45, largest_difference = 0.35;  // logarithms of the radius
    const double in_first = std::log(first.image.radius_px / radius_px(a, met->place));
    const double in_second = std::log(second.image.radius_px / radius_px(b, met->place));
    if (std::max(std::abs(in_first), std::abs(in_second)) > largest_size ||
        std::abs(in_first - in_second) > largest_difference)
      return std::nullopt;
    return met;
  }

 private:
  const TrackCase& given_;
  SequenceImages images_;
  FrameRange frames_;
  Images first_;
  Eigen::Vector3d middle_;  ///< where the views' middles meet
  std::vector<MarkerAppearance> appearance_;
};

std::vector<Match> matches_of(const FirstFrames& frames, std::size_t a, const std::vector<FirstDisc>& first,
                              std::size_t b, const std::vector<FirstDisc>& second) {
  std::vector<Match> matches;
  for (std::size_t i = 0; i < first.size(); ++i)
    for (std::size_t k = 0; k < second.size(); ++k)
      if (const auto met = frames.meeting(a, first[i], b, second[k]))
        matches.push_back({i, k, met->place, Eigen::Vector3d::Zero(), met->chi2});
  return matches;
}

/// Windows around predicted places, those close together once.
std::vector<SearchWindow> windows_at(const FirstFrames& frames, std::size_t view,
                                     const std::vector<Match>& matches) {
  constexpr double same_px = 3;
  std::vector<SearchWindow> windows;
  for (const Match& match : matches) {
    if (!match.is_followed) continue;
    const Eigen::Vector3d place = match.place + match.velocity;
    const auto at = frames.raw(view, place);
    if (!at) continue;
    const double radius = frames.radius_px(view, place);
    const double reach = 2 * radius * fastest_mm + same_px;
    if (std::ranges::none_of(
            windows, [&](const SearchWindow& other) { return (other.centre - *at).norm() < same_px; }))
      windows.push_back({*at, reach, radius, 0});
  }
  return windows;
}

/// Follows the matches into the next frame: of the pairs near each the one whose rays meet best, near where
/// it is expected.
void follow(const FirstFrames& frames, std::size_t a, std::size_t b, const Images& images,
            std::vector<Match>& matches) {
  if (std::ranges::none_of(matches, &Match::is_followed)) return;
  const auto first = frames.discs_in(a, images[a], windows_at(frames, a, matches));
  const auto second = frames.discs_in(b, images[b], windows_at(frames, b, matches));
  for (Match& match : matches) {
    if (!match.is_followed) continue;
    const Eigen::Vector3d expected = match.place + match.velocity;
    const auto in_first = frames.raw(a, expected), in_second = frames.raw(b, expected);
    const double reach_mm = match.seen > 1 ? fastest_mm / 2 : fastest_mm;
    const double reach_a = 2 * frames.radius_px(a, expected) * reach_mm + 2;
    const double reach_b = 2 * frames.radius_px(b, expected) * reach_mm + 2;
    std::optional<SightedPoint> best;
    double least = 0;
    for (const FirstDisc& one : first) {
      if (!in_first || !in_second || (one.image.uv_raw - *in_first).norm() > reach_a) continue;
      for (const FirstDisc& other : second) {
        if ((other.image.uv_raw - *in_second).norm() > reach_b) continue;
        const auto met = frames.meeting(a, one, b, other);
        if (!met || (met->place - expected).norm() > reach_mm) continue;
        const double cost = met->chi2 + (met->place - expected).squaredNorm() / (reach_mm * reach_mm / 9);
        if (!best || cost < least) best = met, least = cost;
      }
    }
    if (!best) {
      ++match.missed;
      match.place = expected;
      continue;
    }
    match.velocity = best->place - match.place;
    match.place = best->place;
    match.chi2 += best->chi2;
    ++match.seen;
  }
  // One that was seen in several frames may be hidden now.
  constexpr int most_missed = 2, enough = 3;
  for (Match& match : matches) match.is_followed = match.is_followed && match.missed <= most_missed;
  std::erase_if(matches, [](const Match& match) { return !match.is_followed && match.seen < enough; });
}

/// Evidence of the frames. Rays miss by the cameras' errors alike in every frame: four frames at most count.
std::vector<DiscPair> pairs_of(const std::vector<Match>& matches) {
  constexpr double most_counted = 4;
  std::vector<DiscPair> pairs;
  for (const Match& match : matches) {
    const double counted = std::min(most_counted, double(match.seen));
    pairs.push_back({match.first, match.second,
                     0.5 * counted * match.chi2 / match.seen + std::log(chance) * (counted / most_counted)});
  }
  return pairs;
}

struct Found {
  std::vector<Match> certain;
  std::vector<std::size_t> ambiguous;  ///< discs of the first view with matches, none of them certain
};

Found found_markers(const FirstFrames& frames, std::size_t a, const std::vector<FirstDisc>& first,
                    std::size_t b, const std::vector<FirstDisc>& second) {
  std::vector<Match> matches = matches_of(frames, a, first, b, second);
  for (int i = 1; i < frames.frame_count() && !matches.empty(); ++i)
    follow(frames, a, b, frames.frame(i), matches);
  Found found;
  const std::vector<DiscPair> pairs = pairs_of(matches);
  std::vector<char> is_certain(first.size());
  for (const std::size_t i : certain_pairs(pairs, margin)) {
    found.certain.push_back(matches[i]);
    is_certain[matches[i].first] = true;
  }
  for (const Match& match : matches)
    if (!is_certain[match.first] && match.missed == 0 &&
        std::ranges::find(found.ambiguous, match.first) == found.ambiguous.end())
      found.ambiguous.push_back(match.first);
  return found;
}

std::size_t certain_count(const FirstFrames& frames) {
  return found_markers(frames, 0, frames.all_discs(0), 1, frames.all_discs(1)).certain.size();
}

void warn(TrackCase& the_case, Reason reason, std::size_t view, const Eigen::Vector2d& at,
          std::string message) {
  the_case.warnings.push_back(
      {reason, std::move(message), the_case.views[view].images.name, {{"u_px", at.x()}, {"v_px", at.y()}}});
}

void find_all(TrackCase& the_case, const FirstFrames& frames, int frame) {
  std::array<int, 2> outside{};
  const auto first = frames.all_discs(0, &outside[0]), second = frames.all_discs(1, &outside[1]);
  for (std::size_t k = 0; k < 2; ++k)
    if (outside[k] > 0)
      the_case.warnings.push_back(
          {Reason::not_seen,
           fmt::format("frame {}: {} {} outside the distortion map of {}: left out", frame, outside[k],
                       outside[k] == 1 ? "disc is" : "discs are", the_case.views[k].images.name),
           the_case.views[k].images.name,
           {{"discs", double(outside[k])}}});
  Found found = found_markers(frames, 0, first, 1, second);
  const std::string &a = the_case.views[0].images.name, &b = the_case.views[1].images.name;
  if (found.certain.empty())
    throw BadInput(
        {Reason::not_seen,
         fmt::format(
             "picks: none, and in frame {} no disc of {:g} mm ({:.1f} px) in {} and one in {} are "
             "certainly one marker's ({} and {} discs): is \"diameter_mm\" right? Else pick the markers",
             frame, the_case.diameter_mm, 2 * frames.middle_radius_px(0), a, b, first.size(), second.size()),
         {},
         {{"discs_first", double(first.size())}, {"discs_second", double(second.size())}}});
  std::ranges::sort(found.certain, [&](const Match& one, const Match& other) {
    const Eigen::Vector2d &p = first[one.first].image.uv_raw, &q = first[other.first].image.uv_raw;
    return std::pair(p.x(), p.y()) < std::pair(q.x(), q.y());
  });
  for (const Match& match : found.certain) {
    const std::size_t marker = the_case.markers.size();
    the_case.markers.push_back(fmt::format("M{}", marker + 1));
    the_case.picks.push_back({marker, 0, first[match.first].image.uv_raw});
    the_case.picks.push_back({marker, 1, second[match.second].image.uv_raw});
    const auto met = frames.meeting(0, first[match.first], 1, second[match.second]);
    for (std::size_t k = 2; met && k < the_case.views.size(); ++k)
      if (const auto at = frames.raw(k, met->place))
        if (const auto disc = frames.picked({marker, k, *at}))
          the_case.picks.push_back({marker, k, disc->image.uv_raw});
  }
  for (const std::size_t i : found.ambiguous) {
    const Eigen::Vector2d& at = first[i].image.uv_raw;
    warn(the_case, Reason::ambiguous_labels, 0, at,
         fmt::format(
             "frame {}: the disc at {:.1f}, {:.1f} has no certain partner in {}: it is left out; pick it in "
             "both views if it is a marker",
             frame, at.x(), at.y(), b));
  }
}

std::size_t picks_of(const TrackCase& the_case, std::size_t marker) {
  return std::size_t(std::ranges::count(the_case.picks, marker, &MarkerPick::marker));
}

/// The other view's disc of each marker that is picked in one.
void find_partners(TrackCase& the_case, const FirstFrames& frames, int frame) {
  const std::vector<MarkerPick> picks = the_case.picks;
  for (std::size_t a = 0; a < the_case.views.size(); ++a) {
    std::vector<FirstDisc> first;
    std::vector<const MarkerPick*> of;
    for (const MarkerPick& pick : picks)
      if (pick.view == a && picks_of(the_case, pick.marker) == 1)
        if (const auto disc = frames.picked(pick)) {
          first.push_back(*disc);
          of.push_back(&pick);
        }
    for (std::size_t b = 0; b < the_case.views.size() && !first.empty(); ++b) {
      if (b == a) continue;
      auto second = frames.all_discs(b);
      std::erase_if(second, [&](const FirstDisc& disc) {
        return std::ranges::any_of(picks, [&](const MarkerPick& pick) {
          return pick.view == b && (pick.uv_raw - disc.image.uv_raw).norm() < disc.image.radius_px + 3;
        });
      });
      for (const Match& match : found_markers(frames, a, first, b, second).certain)
        if (picks_of(the_case, of[match.first]->marker) == 1)
          the_case.picks.push_back({of[match.first]->marker, b, second[match.second].image.uv_raw});
    }
  }
  for (const MarkerPick& pick : picks)
    if (picks_of(the_case, pick.marker) == 1)
      warn(the_case, Reason::target_not_found, pick.view, pick.uv_raw,
           fmt::format(
               "frame {}: \"{}\" is picked in {} only, and no disc of the other views is certainly its "
               "own: it is not followed; pick it in a second view",
               frame, the_case.markers[pick.marker], the_case.views[pick.view].images.name));
}

}  // namespace

void complete_picks(TrackCase& the_case, const FrameRange& frames) {
  const bool is_open =
      the_case.picks.empty() || std::ranges::any_of(the_case.picks, [&](const MarkerPick& pick) {
        return picks_of(the_case, pick.marker) == 1;
      });
  if (!is_open || the_case.views.size() < 2) return;
  const FirstFrames first(the_case, frames);
  if (!the_case.picks.empty()) {
    find_partners(the_case, first, frames.first);
    return;
  }
  // Gaps between bones may look like bright metal: the grey values in which more markers are found count.
  if (first.is_any_inverted())
    if (const FirstFrames stored(the_case, frames, true); certain_count(stored) > certain_count(first)) {
      find_all(the_case, stored, frames.first);
      return;
    }
  find_all(the_case, first, frames.first);
}

}  // namespace helicarm::track
