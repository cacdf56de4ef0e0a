// SPDX-License-Identifier: Apache-2.0
#include "gui/window/surface_view.h"

#include <QKeyEvent>
#include <QMouseEvent>
#include <QPainter>
#include <QWheelEvent>
#include <algorithm>
#include <cmath>
#include <limits>

#include "gui/xray/label_placer.h"
#include "gui/xray/mark_painter.h"

namespace helicarm::gui {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using phantom::TriangleMesh;

const QColor background(13, 16, 21), bone(226, 218, 200);
constexpr double ambient = 0.25;         // of the light, at the surface's edges
constexpr double radians_per_px = 0.01;  // a drag across a window of 300 px turns to the other side
constexpr double zoom_per_step = 1.2, least_zoom = 0.3, most_zoom = 40;
constexpr double key_px = 10;
constexpr int click_px = 4;        // a hand moves this far in a click
constexpr double rounding = 1e-9;  // of a share of a triangle: no gap between two of them
constexpr double hidden_mm = 1;    // a place this far behind the drawn surface is hidden

std::vector<Vector3d> corner_normals(const TriangleMesh& mesh) {
  std::vector<Vector3d> normals(mesh.corners.size(), Vector3d::Zero());
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vector3d across = (mesh.corners[b] - mesh.corners[a]).cross(mesh.corners[c] - mesh.corners[a]);
    for (const std::uint32_t corner : {a, b, c}) normals[corner] += across;
  }
  for (Vector3d& normal : normals) normal.normalize();
  return normals;
}

/// A corner in the window: px from its upper left, mm away, and how bright it is.
struct DrawnCorner {
  double u, v, away, light;
};

double edge(const DrawnCorner& a, const DrawnCorner& b, double u, double v) {
  return (b.u - a.u) * (v - a.v) - (b.v - a.v) * (u - a.u);
}

void draw_triangle(SurfaceImage& image, const DrawnCorner& a, const DrawnCorner& b, const DrawnCorner& c) {
  const double twice_area = edge(a, b, c.u, c.v);
  if (!(std::abs(twice_area) > 0)) return;
  const int width = image.pixels.width(), height = image.pixels.height();
  const auto from = [](double x, double y, double z) { return std::ceil(std::min({x, y, z})); };
  const auto to = [](double x, double y, double z) { return std::floor(std::max({x, y, z})); };
  const int left = int(std::max(0.0, from(a.u, b.u, c.u))), top = int(std::max(0.0, from(a.v, b.v, c.v)));
  const int right = int(std::min(double(width - 1), to(a.u, b.u, c.u)));
  const int bottom = int(std::min(double(height - 1), to(a.v, b.v, c.v)));
  for (int v = top; v <= bottom; ++v) {
    auto* row = reinterpret_cast<QRgb*>(image.pixels.scanLine(v));
    for (int u = left; u <= right; ++u) {
      const double of_a = edge(b, c, u, v) / twice_area, of_b = edge(c, a, u, v) / twice_area;
      const double of_c = 1 - of_a - of_b;
      if (std::min({of_a, of_b, of_c}) < -rounding) continue;
      const auto away = float(of_a * a.away + of_b * b.away + of_c * c.away);
      float& nearest = image.away[std::size_t(v) * std::size_t(width) + std::size_t(u)];
      if (away >= nearest) continue;
      nearest = away;
      const double light = of_a * a.light + of_b * b.light + of_c * c.light;
      row[u] = qRgb(int(bone.red() * light), int(bone.green() * light), int(bone.blue() * light));
    }
  }
}

}  // namespace

Vector3d SurfaceCamera::project(const Vector3d& place) const {
  Vector3d at = turn * (place - middle);
  at.head<2>() *= scale;
  return at;
}

SurfaceImage draw_surface(const TriangleMesh& mesh, const SurfaceCamera& camera, QSize size) {
  SurfaceImage image{QImage(size, QImage::Format_RGB32), {}};
  image.pixels.fill(background);
  image.away.assign(std::size_t(size.width()) * std::size_t(size.height()),
                    std::numeric_limits<float>::infinity());
  const std::vector<Vector3d> normals = corner_normals(mesh);
  std::vector<DrawnCorner> corners(mesh.corners.size());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector3d at = camera.project(mesh.corners[i]);
    // Lit from the viewer; away is positive, so that a normal towards the viewer is negative.
    const double facing = std::max(0.0, -camera.turn.row(2).dot(normals[i]));
    corners[i] = {0.5 * size.width() + at.x(), 0.5 * size.height() + at.y(), at.z(),
                  ambient + (1 - ambient) * facing};
  }
  for (const auto& [a, b, c] : mesh.triangles) draw_triangle(image, corners[a], corners[b], corners[c]);
  return image;
}

std::optional<Vector3d> surface_at(const TriangleMesh& mesh, const SurfaceCamera& camera,
                                   const Vector2d& at) {
  std::vector<Vector3d> corners;
  corners.reserve(mesh.corners.size());
  for (const Vector3d& corner : mesh.corners) corners.push_back(camera.project(corner));
  std::optional<Vector3d> nearest;
  double least = std::numeric_limits<double>::infinity();
  const auto drawn = [&](std::uint32_t i) { return DrawnCorner{corners[i].x(), corners[i].y(), 0, 0}; };
  for (const auto& [i, j, k] : mesh.triangles) {
    const DrawnCorner a = drawn(i), b = drawn(j), c = drawn(k);
    const double twice_area = edge(a, b, c.u, c.v);
    if (!(std::abs(twice_area) > 0)) continue;
    const double of_a = edge(b, c, at.x(), at.y()) / twice_area;
    const double of_b = edge(c, a, at.x(), at.y()) / twice_area, of_c = 1 - of_a - of_b;
    const double away = of_a * corners[i].z() + of_b * corners[j].z() + of_c * corners[k].z();
    if (std::min({of_a, of_b, of_c}) < -rounding || away >= least) continue;
    least = away;
    nearest = of_a * mesh.corners[i] + of_b * mesh.corners[j] + of_c * mesh.corners[k];
  }
  return nearest;
}

SurfaceView::SurfaceView(QWidget* parent) : QWidget(parent) {
  setFocusPolicy(Qt::StrongFocus);
  setObjectName("modelSurface");
  setAccessibleName(tr("Surface of the model"));
  setToolTip(
      tr("A click places the cursor on the surface, a drag or the arrow keys turn it, the wheel, + and - "
         "zoom. Enter places the cursor in the middle."));
}

void SurfaceView::show_scene(const SurfaceScene& scene) {
  const bool is_new = scene.mesh != scene_.mesh;
  scene_ = scene;
  if (!is_new) return update();
  look_from_the_front();
  draw();
}

void SurfaceView::look_from_the_front() {
  if (!scene_.mesh || scene_.mesh->corners.empty()) return;
  // Left of the patient to the right, inferior downwards, posterior away.
  camera_.turn << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  Eigen::AlignedBox3d box;
  for (const Vector3d& corner : scene_.mesh->corners) box.extend(corner);
  camera_.middle = centre_ = box.center();
  reach_mm_ = 1e-6;
  for (const Vector3d& corner : scene_.mesh->corners)
    reach_mm_ = std::max(reach_mm_, (corner - centre_).norm());
  zoom_ = 1;
}

void SurfaceView::fit() { camera_.scale = zoom_ * 0.5 * std::min(width(), height()) / reach_mm_; }

void SurfaceView::draw() {
  image_ = {};
  fit();
  if (scene_.mesh && !scene_.mesh->corners.empty() && width() > 0 && height() > 0)
    image_ = draw_surface(*scene_.mesh, camera_, size());
  update();
}

QPointF SurfaceView::place_of(const Vector3d& place) const {
  const Vector3d at = camera_.project(place);
  return {0.5 * width() + at.x(), 0.5 * height() + at.y()};
}

bool SurfaceView::shows(const Vector3d& place) const {
  const QPoint at = place_of(place).toPoint();
  if (!image_.pixels.rect().contains(at)) return false;
  const std::size_t pixel = std::size_t(at.y()) * std::size_t(image_.pixels.width()) + std::size_t(at.x());
  return camera_.project(place).z() <= double(image_.away[pixel]) + hidden_mm;
}

void SurfaceView::place(const QPointF& at) {
  if (!scene_.mesh) return;
  if (const auto place = surface_at(*scene_.mesh, camera_, {at.x() - 0.5 * width(), at.y() - 0.5 * height()}))
    emit placed(*place);
}

void SurfaceView::turn(double right_px, double down_px) {
  camera_.turn = Eigen::AngleAxisd(radians_per_px * right_px, -Vector3d::UnitY()).toRotationMatrix() *
                 Eigen::AngleAxisd(radians_per_px * down_px, Vector3d::UnitX()).toRotationMatrix() *
                 camera_.turn;
  draw();
}

void SurfaceView::zoom(double factor, const QPointF& at) {
  const Vector3d off(at.x() - 0.5 * width(), at.y() - 0.5 * height(), 0);
  const double before = camera_.scale;
  zoom_ = std::clamp(zoom_ * factor, least_zoom, most_zoom);
  fit();
  camera_.middle += camera_.turn.transpose() * (off / before - off / camera_.scale);
  if (zoom_ <= 1) camera_.middle = centre_;
  draw();
}

void SurfaceView::resizeEvent(QResizeEvent*) { draw(); }

void SurfaceView::mousePressEvent(QMouseEvent* event) {
  if (event->button() != Qt::LeftButton) return;
  pressed_ = last_ = event->position();
  turns_ = false;
}

void SurfaceView::mouseMoveEvent(QMouseEvent* event) {
  if (!(event->buttons() & Qt::LeftButton)) return;
  turns_ = turns_ || (event->position() - pressed_).manhattanLength() > click_px;
  if (!turns_) return;
  const QPointF by = event->position() - last_;
  last_ = event->position();
  turn(by.x(), by.y());
}

void SurfaceView::mouseReleaseEvent(QMouseEvent* event) {
  if (event->button() == Qt::LeftButton && !turns_) place(event->position());
}

void SurfaceView::wheelEvent(QWheelEvent* event) {
  zoom(event->angleDelta().y() > 0 ? zoom_per_step : 1 / zoom_per_step, event->position());
  event->accept();
}

void SurfaceView::keyPressEvent(QKeyEvent* event) {
  switch (event->key()) {
    case Qt::Key_Left:
      return turn(-key_px, 0);
    case Qt::Key_Right:
      return turn(key_px, 0);
    case Qt::Key_Up:
      return turn(0, -key_px);
    case Qt::Key_Down:
      return turn(0, key_px);
    case Qt::Key_Plus:
    case Qt::Key_Equal:
      return zoom(zoom_per_step, {0.5 * width(), 0.5 * height()});
    case Qt::Key_Minus:
      return zoom(1 / zoom_per_step, {0.5 * width(), 0.5 * height()});
    case Qt::Key_Return:
    case Qt::Key_Enter:
      return place({0.5 * width(), 0.5 * height()});
    default:
      QWidget::keyPressEvent(event);
  }
}

void SurfaceView::paint_place(QPainter& painter, const Vector3d& place, const QString& name,
                              const QColor& colour) {
  painter.setOpacity(shows(place) ? 1 : 0.35);  // behind the surface
  paint_open_cross(painter, place_of(place), colour, 3, 9);
  if (!name.isEmpty()) outlined_text(painter, place_of(place) + QPointF(8, -6), name, colour);
  painter.setOpacity(1);
}

void SurfaceView::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.fillRect(rect(), background);
  if (image_.pixels.isNull()) return;
  painter.drawImage(0, 0, image_.pixels);
  painter.setRenderHint(QPainter::Antialiasing);
  for (const auto& [name, place] : scene_.landmarks) paint_place(painter, place, name, ink::point);
  if (scene_.cursor) paint_place(painter, *scene_.cursor, {}, Qt::white);
  if (hasFocus()) {
    painter.setPen(QPen(palette().highlight().color(), 2));
    painter.setBrush(Qt::NoBrush);
    painter.drawRect(QRectF(rect()).adjusted(1, 1, -1, -1));
    paint_open_cross(painter, {0.5 * width(), 0.5 * height()}, ink::quiet, 2, 4);  // of Enter
  }
}

}  // namespace helicarm::gui
