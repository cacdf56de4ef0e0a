// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/track/sequence_data.h"

namespace helicarm::track {

/// A body's geometry and its poses by least squares over the markers that count.
struct Shape {
  std::vector<OptionalPlace> in_body;
  std::vector<std::optional<RigidTransform>> poses;
};

std::optional<RigidTransform> pose_from(const SequenceData& work, const BodyPlan& plan,
                                        const std::vector<OptionalPlace>& in_body, std::size_t f,
                                        const std::vector<char>& counts);

/// Geometry and poses in turn, from the frame that shows most markers on.
Shape shape_of(const SequenceData& work, const BodyPlan& plan, const std::vector<char>& counts);

/// Deviations of a marker in the body from its place as the others show it; nothing where they do not.
std::vector<OptionalPlace> deviations_of(const SequenceData& work, const BodyPlan& plan, const Shape& shape,
                                         const std::vector<char>& counts, std::size_t i);

/// Names markers that moved in their bone, first the one without which the others are most rigid, and takes
/// them out.
void find_loose(const SequenceData& work, const BodyPlan& plan, std::vector<char>& counts, BodySequence& body,
                Shape& shape, const std::vector<int>& frames, std::vector<Warning>& warnings);

}  // namespace helicarm::track
