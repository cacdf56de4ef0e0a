// SPDX-License-Identifier: Apache-2.0
#include "gui/window/objects_panel.h"

#include <QCheckBox>
#include <QGridLayout>
#include <QSignalBlocker>
#include <QSlider>
#include <cmath>
#include <functional>

#include "gui/scene/scene_view.h"
#include "gui/xray/text.h"

namespace helicarm::gui {
namespace {

constexpr int objects_per_row = 3;

int percent(double opacity) { return int(std::lround(100 * opacity)); }

}  // namespace

/// `set_opacity` is empty where it cannot be changed.
struct ObjectsPanel::Object {
  QString name;
  bool is_shown;
  double opacity;
  std::function<void(bool)> show;
  std::function<void(double)> set_opacity;
};

ObjectsPanel::ObjectsPanel(SceneView& scene, QWidget* parent) : QWidget(parent), scene_(scene) {
  grid_ = new QGridLayout(this);
  grid_->setContentsMargins(6, 2, 6, 2);
  for (int i = 0; i < objects_per_row; ++i) grid_->setColumnStretch(2 * i + 1, 1);
  connect(&scene_, &SceneView::objects_changed, this, &ObjectsPanel::follow);
  follow();
}

std::vector<ObjectsPanel::Object> ObjectsPanel::objects() const {
  std::vector<Object> all;
  const SceneOpacity& opacity = scene_.opacity();
  const auto add = [&](const QString& name, ScenePart part, double SceneOpacity::*member) {
    Object object{name,
                  bool(scene_.parts() & part),
                  member ? opacity.*member : 1,
                  [this, part](bool on) { scene_.show_parts(scene_.parts().setFlag(part, on)); },
                  {}};
    if (member)
      object.set_opacity = [this, member](double value) {
        SceneOpacity other = scene_.opacity();
        other.*member = value;
        scene_.set_opacity(other);
      };
    all.push_back(std::move(object));
  };
  add(tr("Calibrator"), ScenePart::calibrator, &SceneOpacity::calibrator);
  add(tr("Rays and detectors"), ScenePart::rays, nullptr);
  add(tr("Points and tunnels"), ScenePart::points, &SceneOpacity::points);
  add(tr("Bones of the rehearsal"), ScenePart::bones, &SceneOpacity::bones);
  add(tr("Robot and tool"), ScenePart::robot, &SceneOpacity::robot);
  for (const std::string& model : scene_.model_names()) {
    const bool is_shown = (scene_.parts() & ScenePart::models) && !scene_.hidden_models().contains(model);
    all.push_back({tr("Model %1").arg(text(model)), is_shown, opacity.of_model(model),
                   [this, model](bool on) {
                     std::set<std::string> hidden = scene_.hidden_models();
                     if (on)
                       hidden.erase(model);
                     else
                       hidden.insert(model);
                     if (on) scene_.show_parts(scene_.parts() | ScenePart::models);
                     scene_.hide_models(std::move(hidden));
                   },
                   [this, model](double value) {
                     SceneOpacity other = scene_.opacity();
                     other.model[model] = value;
                     scene_.set_opacity(other);
                   }});
  }
  return all;
}

void ObjectsPanel::follow() {
  const std::vector<Object> all = objects();
  QStringList names;
  for (const Object& object : all) names << object.name;
  if (names != listed_) list(all);
  for (const Object& object : all) {
    auto* shown = findChild<QCheckBox*>("shown:" + object.name);
    const QSignalBlocker quiet(shown);
    shown->setChecked(object.is_shown);
    auto* opacity = findChild<QSlider*>("opacity:" + object.name);
    if (opacity == nullptr) continue;
    const QSignalBlocker quiet_too(opacity);
    opacity->setValue(percent(object.opacity));
    opacity->setEnabled(object.is_shown);
  }
}

void ObjectsPanel::list(const std::vector<Object>& all) {
  listed_.clear();
  qDeleteAll(findChildren<QWidget*>(QString(), Qt::FindDirectChildrenOnly));
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Object& object = all[i];
    listed_ << object.name;
    const int row = int(i) / objects_per_row, column = 2 * (int(i) % objects_per_row);
    auto* shown = new QCheckBox(object.name);
    shown->setObjectName("shown:" + object.name);
    grid_->addWidget(shown, row, column);
    connect(shown, &QCheckBox::toggled, this, object.show);
    if (!object.set_opacity) continue;
    auto* opacity = new QSlider(Qt::Horizontal);
    opacity->setObjectName("opacity:" + object.name);
    opacity->setAccessibleName(tr("Opacity of %1, per cent").arg(object.name));
    opacity->setToolTip(opacity->accessibleName());
    opacity->setRange(0, 100);
    grid_->addWidget(opacity, row, column + 1);
    connect(opacity, &QSlider::valueChanged, this,
            [set = object.set_opacity](int value) { set(value / 100.0); });
  }
}

}  // namespace helicarm::gui
