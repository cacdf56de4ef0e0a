// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/scene_view.h"

#include <QElapsedTimer>
#include <QPainter>
#include <algorithm>
#include <utility>

#include "gui/scene/offscreen_stage.h"
#include "gui/scene/palette.h"
#include "helicarm/pipeline/middle.h"

namespace helicarm::gui {

namespace {

constexpr Colour amber{255, 196, 0};

/// A model that is refused or out of date is grey.
Colour colour_of(const ModelShape& shape) {
  const bool is_grey =
      shape.state == ModelShape::State::refused || shape.state == ModelShape::State::out_of_date;
  return is_grey ? palette::refused : shape.colour;
}

LiveScene without_robot(LiveScene live) {
  live.calibrator_from_tip.reset();
  live.calibrator_from_base.reset();
  live.path.clear();
  return live;
}

QString words_of(const ModelShape& shape) {
  const QString name = QString::fromStdString(shape.name);
  switch (shape.state) {
    case ModelShape::State::refused:
      return SceneView::tr("%1: refused").arg(name);
    case ModelShape::State::by_hand:
      return SceneView::tr("%1: moved by hand").arg(name);
    case ModelShape::State::not_registered:
      return SceneView::tr("%1: not registered").arg(name);
    case ModelShape::State::out_of_date:
      return SceneView::tr("%1: out of date").arg(name);
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
                            const phantom::Calibrator& calibrator, bool keeps_camera) {
  show_scene(result ? scene_of(*result, calibrator) : ResultScene{},
             pipeline::middle_of(calibrator, result ? result->views : std::vector<pipeline::ViewResult>()),
             keeps_camera);
}

void SceneView::show_scene(ResultScene scene, const Eigen::Vector3d& middle, bool keeps_camera) {
  scene_ = std::move(scene);
  middle_ = middle;
  result_changed_ = live_changed_ = true;
  if (keeps_camera) return redraw();
  set_preset(preset_);
}

void SceneView::show_bones(std::optional<BoneMeshes> bones) {
  bones_ = std::move(bones);
  bones_changed_ = live_changed_ = true;
  redraw();
}

void SceneView::show_models(std::vector<ModelShape> models) {
  const auto before = model_names();
  models_ = std::move(models);
  std::vector<ModelSurfaces::Model> drawn;
  for (const ModelShape& shape : models_) drawn.push_back(shape.model);
  surfaces_.keep(drawn);
  result_changed_ = models_changed_ = live_changed_ = true;
  redraw();
  if (model_names() != before) emit objects_changed();
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
    if (result_changed_) stage.set_result(drawn_scene(), drawn_scale());
    if (bones_changed_) stage.set_bones(parts_ & ScenePart::bones ? bones_ : std::nullopt);
    if (models_changed_) stage.set_models(drawn_models());
    if (slice_changed_)
      stage.set_slice(tre_ ? std::optional(slice_of(*tre_, slice_axis_, slice_mm_)) : std::nullopt,
                      tre_scale_);
    if (live_changed_) stage.set_live(parts_ & ScenePart::robot ? live_ : without_robot(live_));
    if (opacity_changed_) stage.set_opacity(opacity_);
    stage.clear_sight(camera_);
    result_changed_ = bones_changed_ = models_changed_ = slice_changed_ = live_changed_ = opacity_changed_ =
        false;
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

void SceneView::set_notice(const QString& notice) {
  if (std::exchange(notice_, notice) != notice) update();
}

void SceneView::show_parts(SceneParts parts) {
  parts_ = parts;
  result_changed_ = bones_changed_ = models_changed_ = live_changed_ = true;
  redraw();
  emit objects_changed();
}

void SceneView::set_opacity(const SceneOpacity& opacity) {
  opacity_ = opacity;
  opacity_changed_ = models_changed_ = live_changed_ = true;
  redraw();
  emit objects_changed();
}

void SceneView::hide_models(std::set<std::string> names) {
  hidden_ = std::move(names);
  result_changed_ = models_changed_ = live_changed_ = true;
  redraw();
  emit objects_changed();
}

std::vector<std::string> SceneView::model_names() const {
  std::vector<std::string> names;
  for (const ModelShape& shape : models_) names.push_back(shape.name);
  return names;
}

bool SceneView::is_drawn(const ModelShape& shape) const {
  return (parts_ & ScenePart::models) && !hidden_.contains(shape.name);
}

ResultScene SceneView::drawn_scene() const {
  std::vector<ModelShape> drawn;
  std::ranges::copy_if(models_, std::back_inserter(drawn),
                       [&](const auto& shape) { return is_drawn(shape); });
  return only(parts_, with_plans(scene_, drawn));
}

std::vector<DrawnModel> SceneView::drawn_models() const {
  std::vector<DrawnModel> drawn;
  for (const ModelShape& shape : models_)
    drawn.push_back({is_drawn(shape) ? surfaces_.of(shape.model) : nullptr, colour_of(shape),
                     shape.calibrator_from_model, shape.moves_with, opacity_.of_model(shape.name)});
  return drawn;
}

std::vector<SceneLabel> SceneView::labels() const {
  std::vector<SceneLabel> labels;
  const auto carried = [&](const std::optional<guidance::Bone>& bone, const Eigen::Vector3d& place) {
    const auto motion = bone ? live_.bones_moved.find(*bone) : live_.bones_moved.end();
    return motion == live_.bones_moved.end() ? place : motion->second * place;
  };
  const ResultScene drawn = drawn_scene();
  for (const PointShape& point : drawn.points)
    labels.push_back(
        {carried(point.moves_with, point.error.centre), QString::fromStdString(point.name), palette::point});
  for (const ModelShape& shape : models_)
    if (shape.model && is_drawn(shape))
      labels.push_back({carried(shape.moves_with, shape.calibrator_from_model * shape.model->centre),
                        words_of(shape), colour_of(shape)});
  for (std::size_t i = 0; i < drawn.views.size(); ++i) {
    const ViewShape& view = drawn.views[i];
    const QString name = QString::fromStdString(view.name);
    labels.push_back({view.central_ray.from, tr("%1 source").arg(name), palette::of_view(i)});
    labels.push_back({view.detector[2], name, palette::of_view(i)});
  }
  const bool has_robot = parts_ & ScenePart::robot;
  if (has_robot && live_.calibrator_from_tip)
    labels.push_back({live_.calibrator_from_tip->translation, tr("tip"), palette::tool});
  if (has_robot && live_.calibrator_from_base && live_.joints)
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
  if (!notice_.isEmpty()) taken.push_back(paint_note(painter, int(taken.size()), notice_, amber));
  const auto has_ellipsoid = [](const PointShape& point) { return point.error.radii.maxCoeff() > 0; };
  if (std::ranges::any_of(drawn_scene().points, has_ellipsoid))
    taken.push_back(paint_note(painter, int(taken.size()),
                               drawn_scale() == 1
                                   ? tr("95 % ellipsoids, true size")
                                   : tr("95 % ellipsoids, enlarged %1 times").arg(drawn_scale()),
                               palette::point));
  if (tre_) taken.push_back(paint_colour_bar(painter, size(), tr("TRE, mm rms"), tre_scale_));
  paint_triad(painter, size(), camera_);
  paint_labels(painter, size(), camera_, labels(), taken);
  if (const auto at = handle_place()) {
    painter.setRenderHint(QPainter::Antialiasing);
    paint_handle(painter, *at, QColor(handle_->colour[0], handle_->colour[1], handle_->colour[2]));
  }
}

}  // namespace helicarm::gui
