// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "helicarm/xray/xray_image.h"

namespace helicarm {

/// Beyond, an image is not dated by its arrival. Half a second of an exposure's window is left for the way
/// of the quickest image.
inline constexpr double longest_held_s = 1;

/// How long images lie in the C-arm before they are sent. Its clock and ours need not agree: the least
/// difference of a session between arrival and acquisition is their offset and the quickest image's way,
/// and what an image exceeds it by, it was held back. A session whose images were all held back alike
/// shows nothing.
class ImageDelays {
 public:
  /// Of an image that came at this time (monotonic seconds).
  void learn(const AcquisitionTime& acquired, double arrival_s);

  /// By how much it was later than the quickest image dated by the same elements, s. Nothing below the
  /// clocks' drift.
  double held_s(const AcquisitionTime& acquired, double arrival_s) const;

 private:
  struct Least {
    double delay_s;
    double arrival_s;
  };
  std::map<std::string, Least> least_;  ///< by the times' source
};

}  // namespace helicarm
