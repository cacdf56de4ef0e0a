// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/layer_loader.h"

#include <QRunnable>
#include <exception>
#include <functional>
#include <utility>

namespace helicarm::gui {
namespace {

std::shared_ptr<const LoadedLayer> computed(const pipeline::ViewResult& view, Layer layer) try {
  auto loaded = std::make_shared<LoadedLayer>();
  loaded->layer = layer_at_hand(view, layer);
  loaded->pixels = layer_of(view, layer);
  loaded->usual = image::usual_window(loaded->pixels, view.xray_image ? view.xray_image->lowest : 0);
  return loaded;
} catch (const std::exception&) {
  return nullptr;
}

/// One request with its own sender, so that a queued answer cannot reach a deleted receiver.
class LayerJob : public QObject, public QRunnable {
  Q_OBJECT
 public:
  explicit LayerJob(std::function<std::shared_ptr<const LoadedLayer>()> work) : work_(std::move(work)) {}
  void run() override { Q_EMIT done(work_()); }

 Q_SIGNALS:
  void done(std::shared_ptr<const LoadedLayer> layer);

 private:
  std::function<std::shared_ptr<const LoadedLayer>()> work_;
};

}  // namespace

LayerLoader::LayerLoader(QObject* parent) : QObject(parent) { pool_.setMaxThreadCount(1); }

LayerLoader::~LayerLoader() { cancel(); }

void LayerLoader::cancel() { ++*newest_; }

void LayerLoader::load(std::shared_ptr<const pipeline::Result> result, std::size_t view, Layer layer) {
  const unsigned ticket = ++*newest_;
  auto* job = new LayerJob([result = std::move(result), view, layer, ticket, newest = newest_] {
    return ticket == *newest ? computed(result->views[view], layer) : nullptr;
  });
  const auto answer = [this, ticket](const std::shared_ptr<const LoadedLayer>& loaded_layer) {
    if (ticket == *newest_) Q_EMIT loaded(loaded_layer);
  };
  connect(job, &LayerJob::done, this, answer, Qt::QueuedConnection);
  pool_.start(job);
}

}  // namespace helicarm::gui

#include "layer_loader.moc"
