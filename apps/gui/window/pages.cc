// SPDX-License-Identifier: Apache-2.0
#include "gui/window/pages.h"

#include <QButtonGroup>
#include <QHBoxLayout>
#include <QHeaderView>
#include <QRadioButton>
#include <QVBoxLayout>
#include <algorithm>

#include "gui/desk/steps.h"
#include "helicarm/navigation/accuracy.h"

namespace helicarm::gui {
namespace {

QString text(const std::string& words) { return QString::fromStdString(words); }

void fill(QTableWidget* table, const std::vector<QStringList>& rows) {
  table->setRowCount(int(rows.size()));
  for (int row = 0; row < table->rowCount(); ++row)
    for (int column = 0; column < table->columnCount(); ++column) {
      const QString words = rows[std::size_t(row)].value(column);
      if (auto* item = table->item(row, column); item != nullptr)
        item->setText(words);
      else
        table->setItem(row, column, new QTableWidgetItem(words));
    }
}

QString number(double value, int decimals) { return QString::number(value, 'f', decimals); }

}  // namespace

Page::Page(const QString& lead, Desk& desk, QWidget* parent) : QWidget(parent), desk_(desk) {
  auto* column = new QVBoxLayout(this);
  column->setContentsMargins(8, 4, 8, 4);
  auto* words = new QLabel(lead);
  words->setWordWrap(true);
  column->addWidget(words);
}

QPushButton* Page::add_button(const QString& words, const char* name, std::function<void()> act) {
  auto* button = new QPushButton(words);
  button->setObjectName(name);
  layout()->addWidget(button);
  connect(button, &QPushButton::clicked, this, std::move(act));
  return button;
}

HoldButton* Page::add_hold(const QString& words, const char* name, std::function<void()> act) {
  auto* button = new HoldButton(words);
  button->setObjectName(name);
  layout()->addWidget(button);
  connect(button, &HoldButton::held, this, std::move(act));
  return button;
}

QTableWidget* Page::add_table(const QStringList& columns, const char* name) {
  auto* table = new QTableWidget(0, int(columns.size()));
  table->setObjectName(name);
  table->setHorizontalHeaderLabels(columns);
  table->horizontalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);
  table->horizontalHeader()->setStretchLastSection(true);
  table->verticalHeader()->hide();
  table->setEditTriggers(QAbstractItemView::NoEditTriggers);
  table->setSelectionBehavior(QAbstractItemView::SelectRows);
  table->setTabKeyNavigation(false);
  layout()->addWidget(table);
  return table;
}

AcquirePage::AcquirePage(Desk& desk, QWidget* parent)
    : Page(tr("Take an AP and a lateral X-ray of the knee with the calibrator on it."), desk, parent) {
  shots_ = new QWidget;
  new QVBoxLayout(shots_);
  shots_->layout()->setContentsMargins(0, 0, 0, 0);
  layout()->addWidget(shots_);
  where_ = new QLabel;
  where_->setWordWrap(true);
  layout()->addWidget(where_);
  static_cast<QVBoxLayout*>(layout())->addStretch();
}

void AcquirePage::show_state(const DeskState& state) {
  if (views_ != state.views || state.source == Source::files) {
    views_ = state.source == Source::files ? std::vector<std::string>{} : state.views;
    qDeleteAll(shots_->findChildren<QPushButton*>());
    for (const std::string& point : state.check_points) {
      auto* button = new QPushButton(tr("The pointer is on check point %1").arg(text(point)));
      button->setToolTip(tr("Before the first X-ray, and again before the robot goes to this bone"));
      shots_->layout()->addWidget(button);
      connect(button, &QPushButton::clicked, this, [this, point] { desk_.touch(point); });
    }
    for (const std::string& view : views_) {
      const bool own = state.source == Source::virtual_room;
      auto* button = new QPushButton((own ? tr("Shoot %1") : tr("The next X-ray is %1")).arg(text(view)));
      button->setObjectName("shoot" + text(view));
      shots_->layout()->addWidget(button);
      connect(button, &QPushButton::clicked, this,
              [this, view, own] { own ? desk_.shoot(view) : desk_.expect(view); });
    }
  }
  for (QPushButton* button : shots_->findChildren<QPushButton*>()) button->setEnabled(!state.busy);
  where_->setText(state.source == Source::files ? tr("From %1.").arg(text(state.folder.string()))
                  : state.source == Source::devices
                      ? tr("Expecting %1 from the C-arm.").arg(text(state.next_view))
                      : QString());
}

RectifyPage::RectifyPage(Desk& desk, QWidget* parent)
    : Page(tr("The intensifier bends the picture; the plate's dots tell how. The map is right where little "
              "is left over."),
           desk, parent) {
  auto* row = new QHBoxLayout;
  auto* group = new QButtonGroup(this);
  for (const auto& [layer, words, name] : {std::tuple(Layer::raw, tr("Raw"), "layerRaw"),
                                           {Layer::rectified, tr("Rectified"), "layerRectified"},
                                           {Layer::inpainted, tr("Without dots"), "layerInpainted"}}) {
    auto* choice = new QRadioButton(words);
    choice->setObjectName(name);
    choice->setChecked(layer == Layer::rectified);
    group->addButton(choice);
    row->addWidget(choice);
    connect(choice, &QRadioButton::clicked, this, [this, wanted = layer] { emit layer_wanted(wanted); });
  }
  static_cast<QVBoxLayout*>(layout())->addLayout(row);
  table_ = add_table({tr("View"), tr("Dots"), tr("Bent px"), tr("Left px"), tr("Held out")}, "rectifyTable");
}

void RectifyPage::show_state(const DeskState& state) {
  std::vector<QStringList> rows;
  if (state.result)
    for (const ViewResult& view : state.result->views)
      if (view.rectification) {
        const Rectification& done = *view.rectification;
        rows.push_back({text(view.name), QString::number(done.plate_dots.size()),
                        tr("%1 (max %2)").arg(done.raw_mean_px, 0, 'f', 1).arg(done.raw_max_px, 0, 'f', 1),
                        number(done.map.residual_rms_px, 3), number(done.map.held_out_rms_px, 3)});
      }
  fill(table_, rows);
}

CalibratePage::CalibratePage(Desk& desk, QWidget* parent)
    : Page(tr("The twelve balls, named without a click, tell where each X-ray was taken from."), desk,
           parent) {
  views_ = add_table({tr("View"), tr("Balls"), tr("Residual px"), tr("fx px"), tr("Source mm")}, "viewTable");
  views_->setMaximumHeight(110);
  balls_ = add_table({tr("Ball"), tr("View"), tr("State"), tr("Sigma px"), tr("Residual px")}, "ballTable");
}

void CalibratePage::show_state(const DeskState& state) {
  static const std::map<FiducialStatus, QString> words{{FiducialStatus::used, tr("used")},
                                                       {FiducialStatus::occluded, tr("hidden")},
                                                       {FiducialStatus::outside, tr("outside")},
                                                       {FiducialStatus::rejected, tr("rejected")},
                                                       {FiducialStatus::not_found, tr("not found")}};
  std::vector<QStringList> views, balls;
  if (state.result)
    for (const ViewResult& view : state.result->views) {
      if (!view.found) continue;
      const auto used = std::ranges::count(view.found->fiducials, FiducialStatus::used, &Fiducial::status);
      if (view.calibrated) {
        const Eigen::Vector3d source = view.calibrated->view.source_in_world();
        views.push_back({text(view.name), QString("%1/%2").arg(used).arg(view.found->fiducials.size()),
                         number(view.calibrated->reprojection_rms_px, 3),
                         number(view.calibrated->view.intrinsics.fx, 1),
                         QString("%1, %2, %3")
                             .arg(source.x(), 0, 'f', 0)
                             .arg(source.y(), 0, 'f', 0)
                             .arg(source.z(), 0, 'f', 0)});
      }
      for (const Fiducial& ball : view.found->fiducials) {
        const bool measured = ball.status == FiducialStatus::used || ball.status == FiducialStatus::rejected;
        balls.push_back({text(ball.label), text(view.name), words.at(ball.status),
                         measured ? number(ball.sigma_px, 3) : QString(),
                         measured ? number(ball.residual_px, 3) : QString()});
      }
    }
  fill(views_, views);
  fill(balls_, balls);
}

PlanPage::PlanPage(Desk& desk, QWidget* parent)
    : Page(
          tr("Click each tunnel end in both X-rays; the dashed line in the second one says where it can be."),
          desk, parent) {
  next_ = new QLabel;
  next_->setObjectName("nextPick");
  next_->setWordWrap(true);
  next_->setStyleSheet("color: #ffc400; font-weight: bold;");
  layout()->addWidget(next_);
  ends_ = add_table({tr("End"), tr("Clicked in"), tr("Within mm (95 %)"), tr("Rays miss mm")}, "endTable");
  connect(ends_, &QTableWidget::itemSelectionChanged, this, [this] {
    const int row = ends_->currentRow();
    chosen_.reset();
    if (ends_->selectionModel()->hasSelection() && row >= 0)
      chosen_ = ends_->item(row, 0)->text().toStdString();
    emit target_changed();
  });
  snap_ = new QCheckBox(tr("Snap to a &ball of 3 mm"));
  snap_->setChecked(true);
  layout()->addWidget(snap_);
  offered_ = add_button(tr("Take the picks that came with the &plan"), "offeredPicks",
                        [this] { desk_.take_offered_picks(); });
  add_button(tr("&Clear all picks"), "clearPicks", [this] { desk_.clear_picks(); });
  add_map();
}

void PlanPage::add_map() {
  auto* row = new QHBoxLayout;
  auto* map = new QCheckBox(tr("Expected error (&TRE) in 3-D"));
  map->setObjectName("treMap");
  auto* axis = new QComboBox;
  axis->setObjectName("treAxis");
  axis->addItems({"x", "y", "z"});
  axis->setCurrentIndex(2);
  axis->setToolTip(tr("The slice lies across this axis of the calibrator"));
  auto* place = new QSlider(Qt::Horizontal);
  place->setObjectName("trePlace");
  place->setRange(-int(tre_half_mm), int(tre_half_mm));
  place->setAccessibleName(tr("Place of the slice"));
  auto* words = new QLabel;
  for (QWidget* part : std::initializer_list<QWidget*>{map, axis, place, words}) row->addWidget(part);
  static_cast<QVBoxLayout*>(layout())->addLayout(row);
  const auto tell = [this, map, axis, place, words] {
    for (QWidget* part : std::initializer_list<QWidget*>{axis, place}) part->setEnabled(map->isChecked());
    words->setText(tr("%1 mm").arg(place->value()));
    emit map_wanted(map->isChecked()
                        ? std::optional(TreCut{SliceAxis(axis->currentIndex()), double(place->value())})
                        : std::nullopt);
  };
  connect(map, &QCheckBox::toggled, this, tell);
  connect(axis, &QComboBox::currentIndexChanged, this, tell);
  connect(place, &QSlider::valueChanged, this, tell);
  tell();
}

std::optional<WantedPick> PlanPage::target() const {
  const DeskState& state = desk_.state();
  if (!chosen_) return next_pick(state);
  for (const PlannedTunnel& tunnel : state.tunnels)
    if (tunnel.start == *chosen_ || tunnel.end == *chosen_) return WantedPick{*chosen_, "", tunnel.bone};
  return std::nullopt;
}

void PlanPage::show_state(const DeskState& state) {
  std::vector<QStringList> rows;
  for (const PlannedTunnel& tunnel : state.tunnels)
    for (const std::string& end : {tunnel.start, tunnel.end}) {
      QStringList in;
      for (const std::string& view : state.views)
        if (pick_of(state, end, view) != nullptr) in << text(view);
      QString within, gap;
      if (state.result)
        for (const PointResult& point : state.result->points)
          if (point.name == end) {
            if (point.place) {
              within = number(length_at_95(point.place->covariance_in_calibrator), 2);
              gap = number(point.ray_gap_mm, 2);
            } else if (point.reason) {
              within = sentence_of(*point.reason);
            }
          }
      rows.push_back({text(end), in.join(", "), within, gap});
    }
  fill(ends_, rows);
  offered_->setVisible(!state.offered_picks.empty());
  const auto wanted = next_pick(state);
  next_->setText(!state.measured ? tr("The X-rays come first.")
                 : wanted        ? tr("Click %1 in %2.").arg(text(wanted->point), text(wanted->view))
                                 : tr("All ends are placed. To move one, choose it in the table and click."));
}

NavigatePage::NavigatePage(Desk& desk, QWidget* parent)
    : Page(tr("Nothing moves unless you hold a yellow button until it is full. The space bar stops the "
              "robot."),
           desk, parent) {
  says_ = new QLabel;
  says_->setObjectName("robotSays");
  says_->setWordWrap(true);
  layout()->addWidget(says_);
  unlock_ = add_hold(tr("1  &Unlock the robot: I have looked, nobody is near"), "unlock",
                     [this] { desk_.unlock("the person at the screen"); });
  register_ = add_hold(tr("2  &Register it: about a dozen small moves about its tip"), "register",
                       [this] { desk_.register_robot(); });
  tour_ = new QLabel;
  tour_->setWordWrap(true);
  tour_->hide();
  layout()->addWidget(tour_);
  tunnel_ = new QComboBox;
  tunnel_->setObjectName("tunnel");
  tunnel_->setAccessibleName(tr("Tunnel"));
  layout()->addWidget(tunnel_);
  connect(tunnel_, &QComboBox::currentTextChanged, this,
          [this](const QString& name) { desk_.follow(name.toStdString()); });
  plan_ = add_button(tr("3  Plan the &way and show it in both X-rays"), "planWay",
                     [this] { desk_.plan_tunnel(tunnel_->currentText().toStdString()); });
  go_ = add_hold(tr("4  &Go there"), "go", [this] { desk_.go(); });
  withdraw_ = add_hold(tr("5  With&draw the tool"), "withdraw", [this] { desk_.withdraw(); });
  static_cast<QVBoxLayout*>(layout())->addStretch();
}

void NavigatePage::show_state(const DeskState& state) {
  QStringList names;
  for (const PlannedTunnel& tunnel : state.tunnels) names << text(tunnel.name);
  QStringList shown;
  for (int i = 0; i < tunnel_->count(); ++i) shown << tunnel_->itemText(i);
  if (names != shown) {
    tunnel_->clear();
    tunnel_->addItems(names);
  }
  tour_->setText(state.tour);
  tour_->setVisible(!state.tour.isEmpty() && !state.hand_eye_rms_mm);
  allow();
}

void NavigatePage::show_live(const LiveState& live) {
  if (phase_ == live.robot.phase && !live.robot.why) return;
  phase_ = live.robot.phase;
  says_->setText(live.robot.why ? sentence_of(*live.robot.why) : QString());
  allow();
}

void NavigatePage::allow() {
  const DeskState& state = desk_.state();
  const bool free = !state.busy && state.source != Source::files && state.source != Source::none;
  const bool ready = free && phase_ == LinkPhase::ready;
  const bool placed = state.measured && !next_pick(state);
  unlock_->setEnabled(free && (phase_ == LinkPhase::idle || phase_ == LinkPhase::stopped));
  register_->setEnabled(ready && !state.tool_is_out);
  plan_->setEnabled(ready && placed && state.hand_eye_rms_mm && !state.tool_is_out);
  go_->setEnabled(ready && state.order.has_value());
  withdraw_->setEnabled(ready && state.tool_is_out);
}

VerifyPage::VerifyPage(Desk& desk, QWidget* parent)
    : Page(tr("How far (mm) the tool's axis runs from each end by tracker and X-rays, and how far it may be; "
              "then "
              "in the X-rays alone: Eq. 17 in px and mm, and in space."),
           desk, parent) {
  table_ = add_table({tr("Tunnel, end"), tr("Off"), tr("Expect"), tr("px"), tr("mm"), tr("Space")},
                     "outcomeTable");
  add_button(tr("&Export report, CSV, JSON and other formats..."), "export",
             [this] { emit report_wanted(); });
}

void VerifyPage::show_state(const DeskState& state) {
  std::vector<QStringList> rows;
  for (const auto& [name, outcome] : state.outcomes)
    for (const auto& [end, miss, in_xrays] : {std::tuple(tr("start"), &outcome.start, &Verification::start),
                                              std::tuple(tr("end"), &outcome.end, &Verification::end)}) {
      QStringList row{QString("%1, %2").arg(text(name), end), number(miss->distance_mm(), 2),
                      number(miss->predicted_mm(), 2)};
      if (outcome.verification)
        if (const auto& seen = (*outcome.verification).*in_xrays)
          row << number(seen->combined_px, 2) << number(seen->combined_mm, 2) << number(seen->distance_mm, 2);
      rows.push_back(row);
    }
  if (rows.empty() && state.result)
    for (const Verification& line : state.result->verifications)
      for (const auto& [end, seen] : {std::pair(tr("start"), &line.start), {tr("end"), &line.end}})
        if (*seen)
          rows.push_back({QString("%1, %2").arg(text(line.name), end),
                          {},
                          {},
                          number((*seen)->combined_px, 2),
                          number((*seen)->combined_mm, 2),
                          number((*seen)->distance_mm, 2)});
  fill(table_, rows);
}

}  // namespace helicarm::gui
