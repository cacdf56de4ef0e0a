// SPDX-License-Identifier: Apache-2.0
#include "gui/window/pose_images.h"

#include <QPainter>
#include <QVBoxLayout>

#include "gui/window/page_parts.h"
#include "gui/xray/layers.h"
#include "gui/xray/mark_painter.h"

namespace helicarm::gui {
namespace {

using case_registration::CaseRegistration;
using case_registration::RegisteredModel;

constexpr int view_px = 150;  // side of a view

/// A view with the outline, as high as wide.
QImage image_of(const registration::RegistrationView& view, const std::vector<Eigen::Vector2d>& outline,
                const QColor& ink) {
  QImage image(view_px, view_px, QImage::Format_RGB32);
  image.fill(Qt::black);
  const double scale = double(view_px) / std::max(view.grey.width(), view.grey.height());
  QPainter painter(&image);
  painter.setRenderHints(QPainter::Antialiasing | QPainter::SmoothPixmapTransform);
  painter.scale(scale, scale);
  painter.drawImage(QPointF(), windowed(view.grey, image::usual_window(view.grey, view.lowest)));
  QPen pen(ink, 1.5 / scale);
  pen.setCapStyle(Qt::RoundCap);
  painter.setPen(pen);
  for (const Eigen::Vector2d& dot : outline) painter.drawPoint(QPointF(dot.x() + 0.5, dot.y() + 0.5));
  return image;
}

QPixmap image_of(const CaseRegistration& registration, std::size_t model,
                 const std::vector<std::vector<Eigen::Vector2d>>& outlines) {
  const std::size_t views = std::min(outlines.size(), registration.loaded.views.size());
  QPixmap pixels(int(views) * view_px, view_px);
  QPainter painter(&pixels);
  for (std::size_t i = 0; i < views; ++i)
    painter.drawImage(int(i) * view_px, 0,
                      image_of(registration.loaded.views[i], outlines[i], ink::of_model(model)));
  return pixels;
}

}  // namespace

PoseImages::PoseImages(QWidget* parent) : QWidget(parent) {
  auto* column = new QVBoxLayout(this);
  column->setContentsMargins(0, 0, 0, 0);
  auto* lead = new QLabel(tr(
      "The best poses found. Choose the one whose outline follows the bone's edges in every view, if there "
      "is one, then register from here."));
  lead->setWordWrap(true);
  column->addWidget(lead);
  hide();
}

void PoseImages::show_model(const std::shared_ptr<const CaseRegistration>& registration, std::size_t model) {
  if (shown_ == registration && model_ == model) return;
  shown_ = registration;
  model_ = model;
  for (QToolButton* button : buttons_) delete button;
  buttons_.clear();
  const bool has_choice = registration && model < registration->models.size() &&
                          !registration->models[model].alternative_outlines.empty();
  setVisible(has_choice);
  if (!has_choice) return;
  const RegisteredModel& of = registration->models[model];
  for (std::size_t pose = 0; pose <= of.alternative_outlines.size(); ++pose) {
    auto* button = new QToolButton;
    button->setObjectName(QString("pose%1").arg(pose));
    button->setCheckable(true);
    button->setAutoExclusive(false);
    button->setToolButtonStyle(Qt::ToolButtonTextUnderIcon);
    const QPixmap pixels =
        image_of(*registration, model, pose == 0 ? of.outlines : of.alternative_outlines[pose - 1]);
    button->setIcon(pixels);
    button->setIconSize(pixels.size());
    if (pose == 0) {
      button->setText(tr("the pose of the registration"));
    } else {
      const registration::Alternative& other = of.registration.alternatives[pose - 1];
      button->setText(tr("alternative %1: %2 mm away, cost ratio %3")
                          .arg(pose)
                          .arg(other.distance_mm, 0, 'f', 1)
                          .arg(other.cost_ratio, 0, 'f', 2));
    }
    button->setAccessibleName(button->text());
    connect(button, &QToolButton::clicked, this, [this, pose] { emit chosen(pose); });
    layout()->addWidget(button);
    buttons_.push_back(button);
  }
}

void PoseImages::mark(std::optional<std::size_t> pose) {
  for (std::size_t i = 0; i < buttons_.size(); ++i) buttons_[i]->setChecked(pose == i);
}

}  // namespace helicarm::gui
