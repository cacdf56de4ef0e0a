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

/// A stage in an OpenGL context that no window sees, drawn into images. A QOpenGLWidget would have Qt
/// compose its whole window by OpenGL whenever anything in it changes: in software, as a rule here, that
/// takes longer than the scene itself.
class OffscreenStage {
 public:
  OffscreenStage();
  ~OffscreenStage();

  /// Why nothing can be drawn here; nothing: it can.
  const std::optional<QString>& obstacle() const { return obstacle_; }
  /// Lets `prepare` change the stage, then draws it; null where there is an obstacle.
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
