// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/scene_view.h"

#include <QElapsedTimer>
#include <QPainter>

#include "gui/scene/offscreen_stage.h"
#include "gui/scene/palette.h"

namespace helicarm::gui {

namespace {

/// A refused model is grey.
Colour colour_of(const ModelShape& shape) {
  return shape.state == ModelShape::State::refused ? palette::refused : shape.colour;
}

QString words_of(const ModelShape& shape) {
  const QString name = QString::fromStdString(shape.name);
  switch (shape.state) {
    case ModelShape::State::refused:
      return SceneView::tr("%1: refused").arg(name);
    case ModelShape::State::by_hand:
      return SceneView::tr("%1: moved by hand").arg(name);
    case ModelShape::State::registered:
      break;
  }
  return name;
}

}  // namespace

SceneView::SceneView(QWidget* parent)
    : QWidget(parent), camera_(overview_of({}, 1)), stage_(std::make_unique<OffscreenStage>()) {
  setFocusPolicy(Qt::StrongFocus);
  setMinimumSize(120, 120);
  setAttribute(Qt::WA_OpaquePaintEvent);
  setAccessibleName(tr("Scene in space"));
  connect(&surfaces_, &ModelSurfaces::computed, this, [this] {
    models_changed_ = live_changed_ = true;
    redraw();
  });
}

SceneView::~SceneView() = default;

const std::optional<QString>& SceneView::obstacle() const { return stage_->obstacle(); }

void SceneView::redraw() {
  drawn_ = {};
  update();
}

void SceneView::show_result(const std::shared_ptr<const pipeline::Result>& result,
                            const phantom::Calibrator& calibrator) {
  scene_ = result ? scene_of(*result, calibrator) : ResultScene{};
  middle_ = phantom::middle_of(calibrator);
  result_changed_ = live_changed_ = true;
  set_preset(preset_);
}

void SceneView::show_bones(std::optional<BoneMeshes> bones) {
  bones_ = std::move(bones);
  bones_changed_ = live_changed_ = true;
  redraw();
}

void SceneView::show_models(std::vector<ModelShape> models) {
  models_ = std::move(models);
  std::vector<ModelSurfaces::Model> drawn;
  for (const ModelShape& shape : models_) drawn.push_back(shape.model);
  surfaces_.keep(drawn);
  result_changed_ = models_changed_ = live_changed_ = true;
  redraw();
}

void SceneView::show_live(const LiveScene& live) {
  live_ = live;
  live_changed_ = true;
  redraw();
}

void SceneView::show_tre(std::optional<localization::TreVolume> volume, SliceAxis axis, double place_mm) {
  tre_ = std::move(volume);
  if (tre_) tre_scale_ = scale_of(*tre_);
  slice_axis_ = axis;
  slice_mm_ = place_mm;
  slice_changed_ = true;
  redraw();
}

void SceneView::set_error_scale(double scale) {
  error_scale_ = scale;
  result_changed_ = live_changed_ = true;
  redraw();
}

void SceneView::resizeEvent(QResizeEvent*) {
  if (!moved_) camera_ = camera_of(preset_);
  redraw();
}

void SceneView::draw() {
  QElapsedTimer timer;
  timer.start();
  drawn_ = stage_->draw(size() * devicePixelRatioF(), camera_, [this](Stage& stage) {
    if (result_changed_) stage.set_result(with_plans(scene_, models_), error_scale_);
    if (bones_changed_) stage.set_bones(bones_);
    if (models_changed_) stage.set_models(drawn_models());
    if (slice_changed_)
      stage.set_slice(tre_ ? std::optional(slice_of(*tre_, slice_axis_, slice_mm_)) : std::nullopt,
                      tre_scale_);
    if (live_changed_) stage.set_live(live_);
    stage.clear_sight(camera_);
    result_changed_ = bones_changed_ = models_changed_ = slice_changed_ = live_changed_ = false;
  });
  drawn_.setDevicePixelRatio(devicePixelRatioF());
  last_render_ms_ = double(timer.nsecsElapsed()) * 1e-6;
}

void SceneView::paintEvent(QPaintEvent*) {
  if (drawn_.isNull()) draw();
  QPainter painter(this);
  if (obstacle()) {
    painter.fillRect(rect(), palette().window());
    painter.drawText(rect(), Qt::AlignCenter | Qt::TextWordWrap,
                     tr("The scene cannot be drawn.") + "\n" + *obstacle());
    return;
  }
  painter.drawImage(0, 0, drawn_);
  paint_overlay(painter);
}

std::vector<DrawnModel> SceneView::drawn_models() const {
  std::vector<DrawnModel> drawn;
  for (const ModelShape& shape : models_)
    drawn.push_back(
        {surfaces_.of(shape.model), colour_of(shape), shape.calibrator_from_model, shape.moves_with});
  return drawn;
}

std::vector<SceneLabel> SceneView::labels() const {
  std::vector<SceneLabel> labels;
  const auto carried = [&](const std::optional<guidance::Bone>& bone, const Eigen::Vector3d& place) {
    const auto motion = bone ? live_.bones_moved.find(*bone) : live_.bones_moved.end();
    return motion == live_.bones_moved.end() ? place : motion->second * place;
  };
  for (const PointShape& point : with_plans(scene_, models_).points)
    labels.push_back(
        {carried(point.moves_with, point.error.centre), QString::fromStdString(point.name), palette::point});
  for (const ModelShape& shape : models_)
    if (shape.model)
      labels.push_back({carried(shape.moves_with, shape.calibrator_from_model * shape.model->centre),
                        words_of(shape), colour_of(shape)});
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
  for (const auto& [bone, motion] : live_.bones_moved)
    if (const auto moved = moved_bone(scene_, bone, motion))
      labels.push_back({moved->place,
                        tr("%1 moved %2 mm since the image")
                            .arg(QString::fromStdString(bone))
                            .arg(moved->moved_mm, 0, 'f', 1),
                        palette::bone});
  for (const auto& [bone, marker] : live_.calibrator_from_bone_marker)
    labels.push_back({marker.translation, tr("%1 marker").arg(QString::fromStdString(bone)), palette::bone});
  return labels;
}

void SceneView::paint_overlay(QPainter& painter) {
  QFont small = font();
  small.setPixelSize(small.pixelSize() > 0 ? small.pixelSize() - 2 : 12);
  painter.setFont(small);
  std::vector<QRect> taken;
  if (const ViewShape* view = moved_ ? nullptr : view_of(preset_))
    taken.push_back(paint_note(
        painter, 0, tr("From the source of %1").arg(QString::fromStdString(view->name)), palette::text));
  if (!scene_.points.empty() && error_scale_ != 1)
    taken.push_back(paint_note(painter, int(taken.size()),
                               tr("95 % ellipsoids, enlarged %1 times").arg(error_scale_), palette::point));
  if (tre_) taken.push_back(paint_colour_bar(painter, size(), tr("TRE, mm rms"), tre_scale_));
  paint_triad(painter, size(), camera_);
  paint_labels(painter, size(), camera_, labels(), taken);
}

}  // namespace helicarm::gui
