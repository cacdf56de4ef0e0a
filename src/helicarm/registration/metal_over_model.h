// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/registration/register_model.h"

namespace helicarm::registration {

/// Metal over a model in one view: a plate, screws, an instrument.
struct MetalOverModel {
  double length_mm = 0;            ///< of the longest piece, at the depth of the model's centre
  double area_mm2 = 0;             ///< of all pieces, within the model's outline
  double contrast = 0;             ///< of the strongest place, in those of the model's densest parts
  double comparisons_share = 0;    ///< of those of the view, that lie on it or beside it
  double agreement = 0;            ///< their mean
  double agreement_elsewhere = 0;  ///< mean of the others
};

/// Whether parts of a view within the outline of a volume, at the pose found, attenuate more than the
/// volume's densest parts do. Fiducials and other small discs and wires do not count, nor what does not end
/// sharply. Nothing of surfaces: an implant is metal itself.
std::optional<MetalOverModel> metal_over_model(const Model& model, const RegistrationView& view,
                                               const RegisteredView& registered, const Registration& found);

}  // namespace helicarm::registration
