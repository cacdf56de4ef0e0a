// SPDX-License-Identifier: Apache-2.0
#include "gui/window/slice_view.h"

#include <QKeyEvent>
#include <QMouseEvent>
#include <QPainter>
#include <QWheelEvent>
#include <algorithm>
#include <cmath>
#include <tuple>

#include "gui/xray/label_placer.h"
#include "gui/xray/mark_painter.h"
#include "gui/xray/text.h"

namespace helicarm::gui {
namespace {

/// The voxel axes to the right and downwards in a slice across `axis`.
std::pair<int, int> axes_of(int axis) {
  if (axis == 0) return {1, 2};
  return {0, axis == 1 ? 2 : 1};
}

Eigen::Vector3d spacing_of(const volume::Volume& ct) {
  return ct.patient_from_voxel.linear().colwise().norm().transpose();
}

/// Whether a voxel axis is drawn against its direction: left is to the right, posterior and inferior are
/// downwards.
bool is_flipped(const volume::Volume& ct, int axis, bool is_down) {
  const Eigen::Vector3d way = ct.patient_from_voxel.linear().col(axis);
  Eigen::Index main = 0;
  way.cwiseAbs().maxCoeff(&main);
  const bool is_negative = way[main] < 0;
  return is_down && main == 2 ? !is_negative : is_negative;
}

const QColor body_ink(94, 234, 242);

/// The voxels of the slice through the cursor, as they are drawn.
struct Slice {
  Slice(const CtScene& scene, int across)
      : ct(*scene.ct),
        axis(across),
        at(std::clamp(int(std::lround(scene.cursor[axis])), 0, ct.size[axis] - 1)) {
    std::tie(right, down) = axes_of(axis);
    width = ct.size[right];
    height = ct.size[down];
    is_flipped_across = is_flipped(ct, right, false);
    is_flipped_down = is_flipped(ct, down, true);
  }

  /// Of a pixel of the image.
  std::size_t voxel(int u, int v) const {
    Eigen::Vector3i voxel;
    voxel[axis] = at;
    voxel[right] = is_flipped_across ? width - 1 - u : u;
    voxel[down] = is_flipped_down ? height - 1 - v : v;
    return (std::size_t(voxel.z()) * std::size_t(ct.size.y()) + std::size_t(voxel.y())) *
               std::size_t(ct.size.x()) +
           std::size_t(voxel.x());
  }

  const volume::Volume& ct;
  int axis, at, right = 0, down = 0, width = 0, height = 0;
  bool is_flipped_across = false, is_flipped_down = false;
};

}  // namespace

QImage slice_image(const CtScene& scene, int axis) {
  const Slice slice(scene, axis);
  QImage image(slice.width, slice.height, QImage::Format_RGB32);
  const double range = std::max(1.0, scene.high_hu - scene.low_hu);
  for (int v = 0; v < slice.height; ++v)
    for (int u = 0; u < slice.width; ++u) {
      const std::size_t i = slice.voxel(u, v);
      const double share = (double(slice.ct.voxels[i]) - scene.low_hu) / range;
      const int grey = int(std::lround(255 * std::clamp(share, 0.0, 1.0)));
      QRgb colour = qRgb(grey, grey, grey);
      if (scene.labels && (*scene.labels)[i] > 0) {
        const QColor ink = ink::of_model(std::size_t((*scene.labels)[i] - 1));
        colour = qRgb((grey + ink.red()) / 2, (grey + ink.green()) / 2, (grey + ink.blue()) / 2);
      }
      image.setPixel(u, v, colour);
    }
  return image;
}

std::vector<QLineF> body_outline(const CtScene& scene, int axis) {
  std::vector<QLineF> edges;
  if (!scene.body.voxels) return edges;
  const Slice slice(scene, axis);
  const auto inside = [&](int u, int v) {
    return u >= 0 && v >= 0 && u < slice.width && v < slice.height &&
           (*scene.body.voxels)[slice.voxel(u, v)] != 0;
  };
  for (int v = 0; v <= slice.height; ++v)
    for (int u = 0; u <= slice.width; ++u) {
      if (inside(u, v) != inside(u - 1, v)) edges.emplace_back(u, v, u, v + 1);
      if (inside(u, v) != inside(u, v - 1)) edges.emplace_back(u, v, u + 1, v);
    }
  return edges;
}

SliceView::SliceView(int axis, QWidget* parent) : QWidget(parent), axis_(axis) {
  setFocusPolicy(Qt::StrongFocus);
  setObjectName(QString("slice%1").arg(axis));
  setAccessibleName(axis == 2   ? tr("Slice across z")
                    : axis == 1 ? tr("Slice across y")
                                : tr("Slice across x"));
  setToolTip(tr("A click or the arrow keys move the cursor; the wheel, + and - the slice"));
}

void SliceView::show_scene(const CtScene& scene) {
  scene_ = scene;
  drawn_ = scene_.ct ? slice_image(scene_, axis_) : QImage();
  outline_ = scene_.ct ? body_outline(scene_, axis_) : std::vector<QLineF>();
  update();
}

SliceView::Frame SliceView::frame() const {
  const auto [right, down] = axes_of(axis_);
  const Eigen::Vector3d spacing = spacing_of(*scene_.ct);
  const double wide_mm = spacing[right] * drawn_.width(), high_mm = spacing[down] * drawn_.height();
  const double scale = std::min(width() / wide_mm, height() / high_mm);
  return {{0.5 * (width() - scale * wide_mm), 0.5 * (height() - scale * high_mm)},
          scale * spacing[right],
          scale * spacing[down]};
}

QPointF SliceView::place_of(const Eigen::Vector3d& voxel) const {
  const auto [right, down] = axes_of(axis_);
  const Frame at = frame();
  const double u = is_flipped(*scene_.ct, right, false) ? drawn_.width() - 1 - voxel[right] : voxel[right];
  const double v = is_flipped(*scene_.ct, down, true) ? drawn_.height() - 1 - voxel[down] : voxel[down];
  return at.origin + QPointF((u + 0.5) * at.across, (v + 0.5) * at.down);
}

void SliceView::place(const QPointF& at) {
  if (!scene_.ct) return;
  const auto [right, down] = axes_of(axis_);
  const Frame drawn = frame();
  const QPointF off = at - drawn.origin;
  Eigen::Vector3d voxel = scene_.cursor;
  const double u = off.x() / drawn.across - 0.5, v = off.y() / drawn.down - 0.5;
  voxel[right] = is_flipped(*scene_.ct, right, false) ? drawn_.width() - 1 - u : u;
  voxel[down] = is_flipped(*scene_.ct, down, true) ? drawn_.height() - 1 - v : v;
  emit placed(voxel.cwiseMax(0).cwiseMin((scene_.ct->size.array() - 1).matrix().cast<double>()));
}

void SliceView::move_slice(double by) {
  if (!scene_.ct) return;
  Eigen::Vector3d voxel = scene_.cursor;
  voxel[axis_] = std::clamp(voxel[axis_] + by, 0.0, double(scene_.ct->size[axis_] - 1));
  emit placed(voxel);
}

void SliceView::mousePressEvent(QMouseEvent* event) {
  if (event->button() == Qt::LeftButton) place(event->position());
}

void SliceView::mouseMoveEvent(QMouseEvent* event) {
  if (event->buttons() & Qt::LeftButton) place(event->position());
}

void SliceView::wheelEvent(QWheelEvent* event) {
  move_slice(event->angleDelta().y() > 0 ? 1 : -1);
  event->accept();
}

void SliceView::keyPressEvent(QKeyEvent* event) {
  if (!scene_.ct) return QWidget::keyPressEvent(event);
  const Frame drawn = frame();
  const QPointF at = place_of(scene_.cursor);
  switch (event->key()) {
    case Qt::Key_Left:
      return place(at - QPointF(drawn.across, 0));
    case Qt::Key_Right:
      return place(at + QPointF(drawn.across, 0));
    case Qt::Key_Up:
      return place(at - QPointF(0, drawn.down));
    case Qt::Key_Down:
      return place(at + QPointF(0, drawn.down));
    case Qt::Key_Plus:
    case Qt::Key_Equal:
      return move_slice(1);
    case Qt::Key_Minus:
      return move_slice(-1);
    default:
      QWidget::keyPressEvent(event);
  }
}

/// Its outline, and the legend in the corner.
void SliceView::paint_body(QPainter& painter) const {
  if (!scene_.body.voxels) return;
  const Frame at = frame();
  painter.save();
  painter.translate(at.origin);
  painter.scale(at.across, at.down);
  QPen pen(body_ink, 1.5);
  pen.setCosmetic(true);
  painter.setPen(pen);
  painter.drawLines(outline_.data(), int(outline_.size()));
  painter.restore();
  constexpr int off = 8, sample = 18;
  const QPointF corner(off, height() - off);
  painter.setPen(QPen(body_ink, 1.5));
  painter.drawLine(corner - QPointF(0, 4), corner + QPointF(sample, -4));
  outlined_text(painter, corner + QPointF(sample + 6, 0), scene_.body.says, body_ink);
}

void SliceView::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.fillRect(rect(), QColor(13, 16, 21));
  if (!scene_.ct) return;
  const Frame at = frame();
  painter.setRenderHint(QPainter::SmoothPixmapTransform);
  painter.drawImage(QRectF(at.origin, QSizeF(at.across * drawn_.width(), at.down * drawn_.height())), drawn_);
  painter.setRenderHint(QPainter::Antialiasing);
  paint_body(painter);
  const Eigen::Affine3d voxel_from_patient = scene_.ct->patient_from_voxel.inverse();
  constexpr double near_voxels = 2;
  for (const CtTunnel& tunnel : scene_.plan.tunnels) {
    const Eigen::Vector3d start = voxel_from_patient * tunnel.start, end = voxel_from_patient * tunnel.end;
    painter.setPen(QPen(ink::tunnel, 2, Qt::DashLine));  // projected onto the slice
    painter.drawLine(place_of(start), place_of(end));
    if (tunnel.approach) {
      painter.setPen(QPen(ink::tunnel, 1, Qt::DotLine));
      painter.drawLine(place_of(voxel_from_patient * tunnel.approach->first),
                       place_of(voxel_from_patient * tunnel.approach->second));
    }
    outlined_text(painter, place_of(end) + QPointF(6, -6), text(tunnel.name), ink::tunnel);
  }
  painter.setPen(QPen(ink::tool, 2));
  for (std::size_t i = 1; i < scene_.plan.path.size(); ++i)
    painter.drawLine(place_of(voxel_from_patient * scene_.plan.path[i - 1]),
                     place_of(voxel_from_patient * scene_.plan.path[i]));
  for (const auto& [name, seed] : scene_.seeds) {
    const bool is_near = std::abs(seed[axis_] - scene_.cursor[axis_]) <= near_voxels;
    if (!is_near) continue;
    paint_open_cross(painter, place_of(seed), ink::point, 3, 9);
    outlined_text(painter, place_of(seed) + QPointF(8, -6), name, ink::point);
  }
  paint_open_cross(painter, place_of(scene_.cursor), Qt::white, 5, 14);
  if (hasFocus()) {
    painter.setPen(QPen(palette().highlight().color(), 2));
    painter.setBrush(Qt::NoBrush);
    painter.drawRect(QRectF(rect()).adjusted(1, 1, -1, -1));
  }
}

}  // namespace helicarm::gui
