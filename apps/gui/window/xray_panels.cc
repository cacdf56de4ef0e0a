// SPDX-License-Identifier: Apache-2.0
#include "gui/window/xray_panels.h"

#include <QVBoxLayout>
#include <algorithm>
#include <numeric>

#include "gui/controller/stale.h"
#include "gui/controller/steps.h"
#include "gui/window/page_parts.h"
#include "gui/window/style.h"

namespace helicarm::gui {
namespace {

constexpr int thumbnail_px = 64;

/// Every n-th pixel of the image through its usual grey window.
QPixmap thumbnail_of(const xray::XrayImage& xray_image) {
  const image::Image<float>& pixels = xray_image.pixels;
  if (pixels.empty()) return {};
  const int step = std::max(1, std::max(pixels.width(), pixels.height()) / (2 * thumbnail_px));
  image::Image<float> small(pixels.width() / step, pixels.height() / step);
  for (int v = 0; v < small.height(); ++v)
    for (int u = 0; u < small.width(); ++u) small(u, v) = pixels(u * step, v * step);
  return QPixmap::fromImage(windowed(small, image::usual_window(small, xray_image.lowest)))
      .scaled(thumbnail_px, thumbnail_px, Qt::KeepAspectRatio, Qt::SmoothTransformation);
}

struct ViewStatus {
  QString word;
  QColor colour = style::colours().quiet;
  QString why = {};
};

ViewStatus status_of(const ApplicationState& state, const pipeline::ViewResult& view) {
  if (state.source == Source::images) return {QObject::tr("image")};
  if (const QString why = stale(state, Phase::calibrate); !why.isEmpty())
    return {QObject::tr("out of date"), style::colours().amber, why};
  for (const auto& [phase, refusal] : state.refusals)
    if (refusal.view == view.name)
      return {QObject::tr("refused"), style::colours().red, sentence_of(refusal)};
  if (view.calibrated)
    return {QObject::tr("measured"), style::colours().green,
            QObject::tr("reprojection error %1 px rms").arg(view.calibrated->reprojection_rms_px, 0, 'f', 3)};
  if (!view.xray_image) return {QObject::tr("no image")};
  return {QObject::tr("not used"), style::colours().amber,
          QObject::tr("The measurement did not reach this view.")};
}

}  // namespace

XrayPanels::XrayPanels(QWidget* parent) : QWidget(parent) { build(); }

void XrayPanels::build() {
  auto* column = new QVBoxLayout(this);
  column->setContentsMargins(0, 0, 0, 0);
  column->setSpacing(4);
  auto* both = new QSplitter(Qt::Vertical);
  for (QSplitter*& row : rows_) {
    row = new QSplitter(Qt::Horizontal);
    both->addWidget(row);
  }
  for (std::size_t i = 0; i < panels_.size(); ++i) {
    FramedXray* panel = panels_[i] = new FramedXray;
    panel->xray().setObjectName(QString("xray%1").arg(i));
    rows_[i / 2]->addWidget(panel);
    rows_[i / 2]->setStretchFactor(int(i % 2), 1);
    connect(&panel->xray(), &XrayView::picked, this, [this, panel](const QPointF& raw) {
      if (const auto view = panel->view()) emit picked(*view, raw);
    });
    connect(&panel->xray(), &XrayView::pick_moved, this,
            [this, panel](const QString& name, const QPointF& raw) {
              if (const auto view = panel->view()) emit pick_moved(*view, name, raw);
            });
    connect(&panel->xray(), &XrayView::pick_menu_wanted, this,
            [this, panel](const QString& name, const QPoint& global) {
              if (const auto view = panel->view()) emit pick_menu_wanted(*view, name, global);
            });
    connect(&panel->xray(), &XrayView::zoomed, this, &XrayPanels::scale_residuals);
    connect(panel, &FramedXray::frame_read, this, &XrayPanels::displayed);
    connect(panel, &FramedXray::frame_changed, this, [this](std::size_t view, int frame) {
      frames_.at(view) = frame;
      emit frame_changed(view, frame);
      emit displayed();
    });
  }
  column->addWidget(both, 1);
  thumbnails_ = new QListWidget;
  thumbnails_->setObjectName("thumbnails");
  thumbnails_->setAccessibleName(tr("All views"));
  thumbnails_->setFlow(QListView::LeftToRight);
  thumbnails_->setWrapping(false);
  thumbnails_->setSelectionMode(QAbstractItemView::NoSelection);
  thumbnails_->setIconSize({thumbnail_px, thumbnail_px});
  thumbnails_->setFixedHeight(thumbnail_px + 30);
  thumbnails_->setVerticalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
  column->addWidget(thumbnails_);
  connect(thumbnails_, &QListWidget::itemClicked, this,
          [this](QListWidgetItem* item) { display(std::size_t(thumbnails_->row(item))); });
  connect(thumbnails_, &QListWidget::itemActivated, this,
          [this](QListWidgetItem* item) { display(std::size_t(thumbnails_->row(item))); });
}

std::optional<std::size_t> XrayPanels::panel_of(std::size_t view) const {
  const auto panel = std::ranges::find(views_, view);
  return panel == views_.end() ? std::nullopt : std::optional(std::size_t(panel - views_.begin()));
}

std::vector<std::shared_ptr<const pipeline::Result>> XrayPanels::other_frames() const {
  std::vector<std::shared_ptr<const pipeline::Result>> frames;
  for (const FramedXray* panel : panels_)
    if (panel->other_frame()) frames.push_back(panel->other_frame());
  return frames;
}

void XrayPanels::show_state(const ApplicationState& state) {
  result_ = state.result;
  std::vector<std::string> names;
  if (result_)
    for (const pipeline::ViewResult& view : result_->views) names.push_back(view.name);
  std::vector<ViewFile> files = state.files;
  files.resize(names.size());
  const auto same_file = [](const ViewFile& a, const ViewFile& b) { return a.file == b.file; };
  if (names != names_ || !std::ranges::equal(files, files_, same_file)) {
    frames_.clear();
    for (const ViewFile& file : files) frames_.push_back(file.frame);
    views_.clear();
  }
  names_ = std::move(names);
  files_ = std::move(files);
  why_empty_ = state.source == Source::none && !state.busy
                   ? tr("Drag X-ray images, or a case folder, into the window")
                   : QString();
  assign();
  fill_thumbnails(state);
}

void XrayPanels::assign() {
  const std::size_t wanted = std::min(large_, names_.size());
  std::vector<std::size_t> left(names_.size());
  std::iota(left.begin(), left.end(), std::size_t{0});
  views_.resize(std::min(views_.size(), wanted));
  for (const std::size_t view : views_) std::erase(left, view);
  for (std::size_t i = 0; views_.size() < wanted; ++i) views_.push_back(left[i]);
  changed_.resize(wanted);
  for (std::size_t i = 0; i < panels_.size(); ++i) {
    panels_[i]->setVisible(i < std::max(wanted, std::size_t{names_.empty() ? 2u : 1u}));
    fill(i);
  }
  rows_[1]->setVisible(wanted > 2);
  mark_displayed();
}

void XrayPanels::fill(std::size_t panel) {
  if (panel >= views_.size()) return panels_[panel]->clear(why_empty_);
  const std::size_t view = views_[panel];
  if (result_->views[view].xray_image)
    panels_[panel]->show_view(result_, view, files_[view], frames_[view]);
  else
    panels_[panel]->clear(tr("%1: no image yet").arg(text(names_[view])));
}

void XrayPanels::display(std::size_t view) {
  if (view >= names_.size() || panel_of(view)) return;
  const auto panel = std::size_t(std::ranges::min_element(changed_) - changed_.begin());
  views_[panel] = view;
  changed_[panel] = ++changes_;
  fill(panel);
  mark_displayed();
  emit displayed();
}

void XrayPanels::set_large(std::size_t number) {
  if (std::exchange(large_, number) == number) return;
  assign();
  emit displayed();
}

void XrayPanels::set_layer(Layer layer) {
  for (FramedXray* panel : panels_) panel->xray().set_layer(layer);
}

void XrayPanels::scale_residuals() {
  double zoom = 0;
  for (const FramedXray* panel : panels_)
    if (panel->isVisibleTo(this)) zoom = std::max(zoom, panel->xray().zoom_factor());
  for (FramedXray* panel : panels_)
    panel->xray().set_residual_scale(result_ ? residual_scale(*result_, zoom) : ResidualScale{});
}

void XrayPanels::set_out_of_date(const QString& why, const std::set<std::string>& points) {
  for (FramedXray* panel : panels_) {
    panel->xray().set_notice(why.isEmpty() ? QString() : tr("out of date"));
    panel->xray().set_stale_points(points);
  }
}

void XrayPanels::fill_thumbnails(const ApplicationState& state) {
  thumbnails_->setVisible(names_.size() > 2);
  if (std::size_t(thumbnails_->count()) != names_.size()) {
    thumbnails_->clear();
    for (std::size_t i = 0; i < names_.size(); ++i) thumbnails_->addItem(QString());
    thumbed_.assign(names_.size(), nullptr);
  }
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const pipeline::ViewResult& view = result_->views[i];
    QListWidgetItem* item = thumbnails_->item(int(i));
    if (std::exchange(thumbed_[i], view.xray_image) != view.xray_image)
      item->setIcon(view.xray_image ? QIcon(thumbnail_of(*view.xray_image)) : QIcon());
    const ViewStatus status = status_of(state, view);
    item->setText(text(view.name) + "\n" + status.word);
    item->setForeground(status.colour);
    item->setToolTip(status.why);
  }
  mark_displayed();
}

void XrayPanels::mark_displayed() {
  for (int i = 0; i < thumbnails_->count(); ++i)
    thumbnails_->item(i)->setBackground(panel_of(std::size_t(i)) ? style::colours().raised
                                                                 : style::colours().ground);
}

}  // namespace helicarm::gui
