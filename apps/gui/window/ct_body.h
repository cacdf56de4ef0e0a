// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "gui/window/slice_view.h"
#include "helicarm/pipeline/case_model.h"

namespace helicarm::gui {

/// The voxels of a model in its CT, by its mask or its window; none where it has neither. Throws BadInput as
/// `case_registration::body_in`.
CtBody body_of(const volume::Volume& ct, const pipeline::CaseModel& model);

}  // namespace helicarm::gui
