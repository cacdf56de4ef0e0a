// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "helicarm/xray/xray_image.h"

namespace helicarm::operation {

/// An image with a longer delay is not dated by its arrival. The acquisition window leaves 0.5 s for the
/// transfer of the fastest image.
inline constexpr double longest_held_s = 1;

/// Estimates how long images are delayed in the C-arm. The clocks need not be synchronised: the least
/// difference between arrival and acquisition in a session is the clock offset plus the fastest transfer, and
/// the excess of an image over it is its delay. A delay common to all images is not detected.
class ImageDelays {
 public:
  /// Adds an image that arrived at this time (monotonic seconds).
  void learn(const xray::AcquisitionTime& acquired, double arrival_s);

  /// Delay relative to the fastest image dated by the same DICOM elements, s. Zero below the clocks' drift.
  double held_s(const xray::AcquisitionTime& acquired, double arrival_s) const;

 private:
  struct Least {
    double delay_s;
    double arrival_s;
  };
  std::map<std::string, Least> least_;  ///< by source of the acquisition time
};

}  // namespace helicarm::operation
