// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/track/tracked.h"
#include "helicarm/track/tracker.h"

namespace helicarm::track {

/// A marker's place in its body.
struct PlacedMarker {
  std::size_t marker;
  /// World frame of the first frame, also of a geometry with coordinates of its own; nothing: not known, or
  /// its body has no pose there.
  std::optional<FramePlace> in_body = {};
  double loose_mm = 0;               ///< rms of its deviations per axis, from the other markers
  std::optional<int> moved_at = {};  ///< frame at which it moved in its bone
};

/// A body through the sequence.
struct BodySequence {
  std::vector<PlacedMarker> markers;
  double deviation_mm = 0;     ///< of a marker from its place, per axis
  double condition_per_m = 0;  ///< of its markers' configuration, as radiostereometry states it
  std::vector<TrackedBody> frames, smoothed;
  std::optional<MotionPrior> prior;
  double noise_factor = 1, turn_noise_factor = 1;  ///< as `SmoothMotion`
};

/// Delay of a view against the first one.
struct ViewDelay {
  double frames = 0, sigma = 0;
  bool is_known = false;
};

/// Distance between two markers over the frames in which both are tracked.
struct MarkerDistance {
  std::size_t first, second;
  double mean_mm, deviation_mm;
  int frames;
};

/// Everything that is known of a sequence.
struct Sequence {
  std::vector<int> frames;
  std::vector<std::vector<TrackedMarker>> markers;              ///< [frame][marker]
  std::vector<std::vector<std::optional<MarkerImage>>> images;  ///< [frame][marker * views + view]
  std::vector<BodySequence> bodies;
  std::vector<std::vector<TrackedBody>> relative;  ///< [body - 1][frame], to the first body
  std::vector<Joint> joints;                       ///< of the case's axes, by the smoothed poses
  std::vector<ViewDelay> delays;                   ///< per view
  double correlation = 0;                          ///< of the images' errors between neighbouring frames
  double lasting = 0;                              ///< part of their variance that lasts over the sequence
  std::vector<double> sigma_factor;                ///< per marker, of the fits' standard deviations
  std::vector<MarkerDistance> distances;
  std::vector<FrameSights> sights = {};  ///< as they were found, of a sequence of images
  int repaired = 0, complete = 0;
  std::vector<Warning> warnings;
  std::optional<Failure> failure;  ///< nothing that was asked for was followed, or names are exchanged
  double seconds = 0;
};

/// From the sights of all frames to markers, bodies and smooth motion.
Sequence estimate_sequence(const TrackCase& the_case, const std::vector<FrameSights>& sights);

}  // namespace helicarm::track
