// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QImage>

#include "helicarm/image/grey_window.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::gui {

/// What can be shown of one exposure: as stored, freed of the distortion, and that without the plate's dots.
enum class Layer { raw, rectified, inpainted };

/// The layer that is there to show: the raw one where the view is not rectified.
Layer layer_at_hand(const ViewResult& view, Layer wanted);

/// The layer's image; empty where there is no exposure. May take a tenth of a second.
Image<float> layer_of(const ViewResult& view, Layer layer);

/// The image through a grey window. The window itself comes from `usual_window`
/// (helicarm/image/grey_window.h).
QImage windowed(const Image<float>& image, GreyWindow window);

}  // namespace helicarm::gui
