// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QImage>
#include <QOffscreenSurface>
#include <QOpenGLContext>
#include <QOpenGLFramebufferObject>
#include <memory>
#include <optional>

#include "gui/scene/stage.h"

namespace helicarm::gui {

/// A stage in an offscreen OpenGL context, rendered to images. A QOpenGLWidget would make Qt compose the
/// whole window by OpenGL at every change, which in software rendering takes longer than the scene.
class OffscreenStage {
 public:
  OffscreenStage();
  ~OffscreenStage();

  /// Why rendering is impossible; empty if it is possible.
  const std::optional<QString>& obstacle() const { return obstacle_; }
  /// Lets `prepare` change the stage, then renders it; a null image if rendering is impossible.
  template <class Prepare>
  QImage draw(const QSize& pixels, const SceneCamera& camera, Prepare prepare) {
    if (!begin(pixels)) return {};
    prepare(*stage_);
    return finish(camera);
  }

 private:
  bool begin(const QSize& pixels);
  QImage finish(const SceneCamera& camera);

  QOffscreenSurface surface_;
  QOpenGLContext context_;
  std::optional<QString> obstacle_;
  std::unique_ptr<QOpenGLFramebufferObject> target_;
  std::unique_ptr<Stage> stage_;
};

}  // namespace helicarm::gui
