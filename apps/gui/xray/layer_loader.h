// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QObject>
#include <QThreadPool>
#include <atomic>
#include <memory>

#include "gui/xray/layers.h"

namespace helicarm::gui {

/// A layer's image and its default grey window.
struct LoadedLayer {
  Layer layer;
  image::Image<float> pixels;
  image::GreyWindow usual;
};

/// Computes layers in a separate thread. Only the newest request is answered.
class LayerLoader : public QObject {
  Q_OBJECT
 public:
  explicit LayerLoader(QObject* parent = nullptr);
  ~LayerLoader() override;

  void load(std::shared_ptr<const pipeline::Result> result, std::size_t view, Layer layer);
  /// Cancels the pending request.
  void cancel();

 Q_SIGNALS:
  /// Null if it could not be computed.
  void loaded(std::shared_ptr<const LoadedLayer> layer);

 private:
  using Ticket = std::atomic<unsigned>;
  std::shared_ptr<Ticket> newest_ = std::make_shared<Ticket>(0);
  QThreadPool pool_;
};

}  // namespace helicarm::gui
