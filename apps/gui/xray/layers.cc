// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/layers.h"

#include <memory>

#include "helicarm/rectification/inpaint.h"

namespace helicarm::gui {

Layer layer_at_hand(const pipeline::ViewResult& view, Layer wanted) {
  return view.rectification ? wanted : Layer::raw;
}

image::Image<float> layer_of(const pipeline::ViewResult& view, Layer layer) {
  if (!view.xray_image) return {};
  const auto& rectification = view.rectification;
  switch (layer_at_hand(view, layer)) {
    case Layer::raw:
      break;
    case Layer::rectified:
      return rectification::resample(*view.xray_image, rectification->map);
    case Layer::inpainted: {
      xray::XrayImage hidden = *view.xray_image;
      hidden.pixels = rectification::inpainted(view.xray_image->pixels, rectification->plate_dots);
      return rectification::resample(hidden, rectification->map);
    }
  }
  return view.xray_image->pixels;
}

QImage windowed(const image::Image<float>& image, image::GreyWindow window) {
  if (image.empty()) return {};
  auto grey = std::make_unique<image::Image<std::uint8_t>>(image::eight_bit(image, window));
  const uchar* pixels = grey->row(0);
  const int width = grey->width(), height = grey->height();
  const auto discard = [](void* owner) { delete static_cast<image::Image<std::uint8_t>*>(owner); };
  return QImage(pixels, width, height, width, QImage::Format_Grayscale8, discard, grey.release());
}

}  // namespace helicarm::gui
