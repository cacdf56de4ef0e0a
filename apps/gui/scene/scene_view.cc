// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/scene_view.h"

#include <QElapsedTimer>
#include <QEvent>
#include <QOffscreenSurface>
#include <QOpenGLContext>
#include <QOpenGLFunctions>
#include <QTimer>

#include "gui/scene/palette.h"
#include "gui/scene/stage.h"

namespace helicarm::gui {

SceneView::SceneView(QWidget* parent)
    : QOpenGLWidget(parent), camera_(overview_of({}, 1)), notice_(new QLabel(this)) {
  setFormat(default_format());
  setFocusPolicy(Qt::StrongFocus);
  setMinimumSize(120, 120);
  setAccessibleName(tr("Scene in space"));
  notice_->setAlignment(Qt::AlignCenter);
  notice_->setWordWrap(true);
  notice_->setAutoFillBackground(true);
  notice_->hide();
}

SceneView::~SceneView() { tear_down(); }

QSurfaceFormat SceneView::default_format() {
  QSurfaceFormat format;
  format.setRenderableType(QSurfaceFormat::OpenGL);
  format.setVersion(3, 2);
  format.setProfile(QSurfaceFormat::CoreProfile);
  format.setDepthBufferSize(24);
  format.setStencilBufferSize(8);
  format.setSamples(0);
  return format;
}

std::optional<QString> SceneView::obstacle() {
  QOffscreenSurface surface;
  surface.setFormat(default_format());
  surface.create();
  QOpenGLContext context;
  context.setFormat(default_format());
  if (!context.create() || !context.makeCurrent(&surface)) return tr("There is no OpenGL here.");
  return obstacle_of(context.format());
}

std::optional<QString> SceneView::obstacle_of(const QSurfaceFormat& format) {
  if (format.renderableType() != QSurfaceFormat::OpenGLES && format.version() >= qMakePair(3, 2)) return {};
  return tr("OpenGL 3.2 is needed; here is %1.%2.").arg(format.majorVersion()).arg(format.minorVersion());
}

void SceneView::show_result(std::shared_ptr<const Result> result, const Calibrator& calibrator) {
  scene_ = result ? scene_of(*result, calibrator) : ResultScene{};
  middle_ = middle_of(calibrator);
  result_changed_ = live_changed_ = true;
  set_preset(preset_);
}

void SceneView::show_bones(std::optional<BoneMeshes> bones) {
  bones_ = std::move(bones);
  bones_changed_ = live_changed_ = true;
  update();
}

void SceneView::show_live(const LiveScene& live) {
  live_ = live;
  live_changed_ = true;
  update();
}

void SceneView::show_tre(std::optional<TreVolume> volume, SliceAxis axis, double place_mm) {
  tre_ = std::move(volume);
  if (tre_) tre_scale_ = scale_of(*tre_);
  slice_axis_ = axis;
  slice_mm_ = place_mm;
  slice_changed_ = true;
  update();
}

void SceneView::set_error_scale(double scale) {
  error_scale_ = scale;
  result_changed_ = live_changed_ = true;
  update();
}

void SceneView::initializeGL() {
  if (const auto reason = obstacle_of(context()->format())) return give_up(*reason);
  connect(context(), &QOpenGLContext::aboutToBeDestroyed, this, &SceneView::tear_down, Qt::DirectConnection);
  stage_ = std::make_unique<Stage>();
  result_changed_ = bones_changed_ = slice_changed_ = live_changed_ = true;
}

void SceneView::tear_down() {
  if (!stage_) return;
  makeCurrent();
  stage_.reset();
  doneCurrent();
}

void SceneView::give_up(const QString& reason) {
  if (std::exchange(given_up_, true)) return;
  notice_->setText(tr("The scene cannot be drawn.") + "\n" + reason);
  notice_->setGeometry(rect());
  notice_->show();
  emit unavailable(reason);
}

void SceneView::resizeGL(int, int) {
  if (!moved_) camera_ = camera_of(preset_);
}

void SceneView::paintGL() {
  if (!stage_) return;
  QElapsedTimer timer;
  timer.start();
  if (result_changed_) stage_->set_result(scene_, error_scale_);
  if (bones_changed_) stage_->set_bones(bones_);
  if (slice_changed_)
    stage_->set_slice(tre_ ? std::optional(slice_of(*tre_, slice_axis_, slice_mm_)) : std::nullopt,
                      tre_scale_);
  if (live_changed_) stage_->set_live(live_);
  result_changed_ = bones_changed_ = slice_changed_ = live_changed_ = false;
  const QSize pixels = size() * devicePixelRatioF();
  stage_->resize(pixels.width(), pixels.height());
  stage_->render(camera_, defaultFramebufferObject());
  QOpenGLFunctions* gl = context()->functions();
  gl->glBindFramebuffer(GL_FRAMEBUFFER, defaultFramebufferObject());
  gl->glUseProgram(0);
  paint_overlay();
  // What lies behind this widget must not shine through.
  gl->glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_TRUE);
  gl->glClearColor(0, 0, 0, 1);
  gl->glClear(GL_COLOR_BUFFER_BIT);
  gl->glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  gl->glFinish();
  last_render_ms_ = double(timer.nsecsElapsed()) * 1e-6;
}

void SceneView::showEvent(QShowEvent* event) {
  QOpenGLWidget::showEvent(event);
  QTimer::singleShot(0, this, [this] {
    if (isVisible() && !isValid()) give_up(tr("There is no OpenGL here."));
  });
}

void SceneView::resizeEvent(QResizeEvent* event) {
  QOpenGLWidget::resizeEvent(event);
  notice_->setGeometry(rect());
}

void SceneView::changeEvent(QEvent* event) {
  if (event->type() == QEvent::LanguageChange || event->type() == QEvent::FontChange) update();
  QOpenGLWidget::changeEvent(event);
}

std::vector<SceneLabel> SceneView::labels() const {
  std::vector<SceneLabel> labels;
  const auto carried = [&](const std::optional<Bone>& bone, const Eigen::Vector3d& place) {
    if (!bone) return place;
    const auto& motion =
        *bone == Bone::femur ? live_.calibrator_from_femur_now : live_.calibrator_from_tibia_now;
    return motion ? *motion * place : place;
  };
  for (const PointShape& point : scene_.points)
    labels.push_back(
        {carried(point.moves_with, point.error.centre), QString::fromStdString(point.name), palette::point});
  for (std::size_t i = 0; i < scene_.views.size(); ++i) {
    const ViewShape& view = scene_.views[i];
    const QString name = QString::fromStdString(view.name);
    labels.push_back({view.central_ray.from, tr("%1 source").arg(name), palette::of_view(i)});
    labels.push_back({view.detector[2], name, palette::of_view(i)});
  }
  if (live_.calibrator_from_tip)
    labels.push_back({live_.calibrator_from_tip->translation, tr("tip"), palette::tool});
  if (live_.calibrator_from_base && live_.joints)
    labels.push_back(
        {live_.calibrator_from_base->translation, QString::fromStdString(live_.robot_model), palette::joint});
  if (live_.calibrator_from_femur_marker)
    labels.push_back({live_.calibrator_from_femur_marker->translation, tr("femur marker"), palette::bone});
  if (live_.calibrator_from_tibia_marker)
    labels.push_back({live_.calibrator_from_tibia_marker->translation, tr("tibia marker"), palette::bone});
  return labels;
}

void SceneView::paint_overlay() {
  QPainter painter(this);
  QFont small = font();
  small.setPixelSize(11);
  painter.setFont(small);
  std::vector<QRect> taken;
  if (const ViewShape* view = moved_ ? nullptr : view_of(preset_))
    taken.push_back(paint_note(
        painter, 0, tr("From the source of %1").arg(QString::fromStdString(view->name)), palette::text));
  if (!scene_.points.empty() && error_scale_ != 1)
    taken.push_back(paint_note(painter, int(taken.size()),
                               tr("95 % ellipsoids, %1 times as large").arg(error_scale_), palette::point));
  if (tre_) taken.push_back(paint_colour_bar(painter, size(), tr("TRE, mm rms"), tre_scale_));
  paint_triad(painter, size(), camera_);
  paint_labels(painter, size(), camera_, labels(), taken);
}

}  // namespace helicarm::gui
