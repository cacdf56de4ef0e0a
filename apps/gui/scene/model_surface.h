// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QObject>
#include <QThreadPool>
#include <map>
#include <memory>
#include <vector>

#include "helicarm/registration/model.h"

namespace helicarm::gui {

/// Of one model: keeps software rendering fluent.
inline constexpr std::size_t most_model_triangles = 60'000;

/// The surface of a model in its own coordinates, to be drawn: its mesh, or the isosurface of its density at
/// half the mean of its voxels, without what it encloses. Coarsened to at most `most_model_triangles`.
phantom::TriangleMesh surface_of(const registration::Model& model);

/// Surfaces of models, each computed once, in another thread.
class ModelSurfaces : public QObject {
  Q_OBJECT

 public:
  using Model = std::shared_ptr<const registration::Model>;
  using Surface = std::shared_ptr<const phantom::TriangleMesh>;

  explicit ModelSurfaces(QObject* parent = nullptr);

  /// Computes those of new models and forgets those of all others.
  void keep(const std::vector<Model>& models);
  /// Null until it is computed.
  Surface of(const Model& model) const;

 signals:
  void computed();

 private:
  std::map<Model, Surface> surfaces_;
  QThreadPool pool_;  ///< last: its jobs use the others
};

}  // namespace helicarm::gui
