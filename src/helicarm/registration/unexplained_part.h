// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/registration/cut_plane.h"

namespace helicarm::registration {

/// What a part of a model shows when it is registered alone, from the pose of the whole.
struct PartAlone {
  double agreement = 0;  ///< mean over the views
  double moved_mm = 0;   ///< from the pose of the whole: rms over its samples
  double turned_deg = 0;
  std::optional<Reason> refused = {};
};

/// A part of a volume that the pose found does not explain, though it explains the model.
struct UnexplainedPart {
  CutPlane cut;           ///< between the part and the rest
  bool is_upper = false;  ///< the part is that towards the axis' upper end
  /// Centres of what lies at the cut, of the part and of the rest; model coordinates.
  Eigen::Vector3d section = Eigen::Vector3d::Zero(), centre = section, centre_of_rest = section;
  std::vector<double> agreements = {};  ///< of each view: mean by the comparisons' weights
  std::vector<double> agreements_elsewhere = {};
  double agreement = 0, agreement_elsewhere = 0;  ///< means over the views
  std::optional<PartAlone> alone = {};

  double difference() const { return agreement_elsewhere - agreement; }
};

/// By which a part's agreement must be lower, as a mean over the views, if nothing else is known of it.
inline constexpr double clear_difference = 0.4;

/// The part beyond a plane whose comparisons agree less than the rest's in two or more views, if by
/// `clear_difference`, or if the part alone agrees better elsewhere. Each side has 16 comparisons and a tenth
/// of the weight in each view: of fewer, lower agreement may be chance. Nothing of a surface. Without
/// `register_part` the difference decides.
std::optional<UnexplainedPart> unexplained_part(const Model& model,
                                                const std::vector<RegistrationView>& views,
                                                const Registration& found, const RegisterPart& register_part);

}  // namespace helicarm::registration
