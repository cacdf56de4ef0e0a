// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QImage>

#include "helicarm/image/grey_window.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::gui {

/// Display layers of an X-ray image: raw, rectified, and rectified without the plate's dots.
enum class Layer { raw, rectified, inpainted };

/// The available layer: raw if the view is not rectified.
Layer layer_at_hand(const pipeline::ViewResult& view, Layer wanted);

/// The layer's image; empty without an X-ray image. Takes up to 0.1 s.
image::Image<float> layer_of(const pipeline::ViewResult& view, Layer layer);

/// The image through a grey window. The window itself comes from `usual_window`
/// (helicarm/image/grey_window.h).
QImage windowed(const image::Image<float>& image, image::GreyWindow window);

}  // namespace helicarm::gui
