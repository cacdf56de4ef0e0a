// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QStringList>
#include <QWidget>

class QGridLayout;

namespace helicarm::gui {

class SceneView;

/// Each part and model of the scene: shown or hidden, and how opaque.
class ObjectsPanel : public QWidget {
  Q_OBJECT

 public:
  explicit ObjectsPanel(SceneView& scene, QWidget* parent = nullptr);

 private:
  struct Object;
  std::vector<Object> objects() const;
  void follow();
  void list(const std::vector<Object>& all);

  SceneView& scene_;
  QGridLayout* grid_;
  QStringList listed_;
};

}  // namespace helicarm::gui
