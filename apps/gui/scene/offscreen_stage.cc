// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/offscreen_stage.h"

#include <QCoreApplication>
#include <QOpenGLFunctions>

namespace helicarm::gui {
namespace {

QString tr(const char* text) { return QCoreApplication::translate("OffscreenStage", text); }

/// The surface format that VTK requires.
QSurfaceFormat wanted_format() {
  QSurfaceFormat format;
  format.setRenderableType(QSurfaceFormat::OpenGL);
  format.setVersion(3, 2);
  format.setProfile(QSurfaceFormat::CoreProfile);
  return format;
}

}  // namespace

OffscreenStage::OffscreenStage() {
  surface_.setFormat(wanted_format());
  surface_.create();
  context_.setFormat(wanted_format());
  if (!context_.create() || !context_.makeCurrent(&surface_)) {
    obstacle_ = tr("OpenGL is not available.");
    return;
  }
  const QSurfaceFormat format = context_.format();
  if (format.renderableType() == QSurfaceFormat::OpenGLES || format.version() < qMakePair(3, 2))
    obstacle_ = tr("OpenGL 3.2 is required; %1.%2 is available.")
                    .arg(format.majorVersion())
                    .arg(format.minorVersion());
  else
    stage_ = std::make_unique<Stage>();
}

OffscreenStage::~OffscreenStage() {
  if (!stage_) return;
  context_.makeCurrent(&surface_);
  stage_.reset();
  target_.reset();
  context_.doneCurrent();
}

bool OffscreenStage::begin(const QSize& pixels) {
  if (obstacle_) return false;
  if (!context_.makeCurrent(&surface_)) {
    obstacle_ = tr("The OpenGL context was lost.");
    return false;
  }
  if (!target_ || target_->size() != pixels) {
    target_ = std::make_unique<QOpenGLFramebufferObject>(pixels);
    stage_->resize(pixels.width(), pixels.height());
  }
  return true;
}

QImage OffscreenStage::finish(const SceneCamera& camera) {
  stage_->render_upside_down(camera, target_->handle());
  QImage image(target_->size(), QImage::Format_RGB32);
  QOpenGLFunctions* gl = context_.functions();
  gl->glBindFramebuffer(GL_FRAMEBUFFER, target_->handle());
  gl->glUseProgram(0);
  gl->glReadPixels(0, 0, image.width(), image.height(), GL_BGRA, GL_UNSIGNED_BYTE, image.bits());
  return image;
}

}  // namespace helicarm::gui
