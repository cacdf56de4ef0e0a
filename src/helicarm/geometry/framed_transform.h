// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::geometry {

/// A pose read from a file or a device, with the names of its frames: to_from_from.
struct FramedTransform {
  std::string to;
  std::string from;
  RigidTransform transform;

  FramedTransform inverse() const { return {from, to, transform.inverse()}; }
};

/// Throws std::invalid_argument if the inner frames differ.
inline FramedTransform operator*(const FramedTransform& left, const FramedTransform& right) {
  if (left.from != right.to)
    throw std::invalid_argument(left.to + "_from_" + left.from + " does not fit " + right.to + "_from_" +
                                right.from);
  return {left.to, right.from, left.transform * right.transform};
}

}  // namespace helicarm::geometry
