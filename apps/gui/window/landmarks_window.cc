// SPDX-License-Identifier: Apache-2.0
#include "gui/window/landmarks_window.h"

#include <QApplication>
#include <QGridLayout>
#include <QHBoxLayout>
#include <QPointer>
#include <QShortcut>
#include <QSignalBlocker>
#include <QThreadPool>
#include <algorithm>

#include "gui/controller/model_landmarks.h"
#include "gui/controller/steps.h"
#include "gui/scene/model_surface.h"
#include "gui/window/ct_body.h"
#include "gui/window/list_table.h"
#include "gui/xray/text.h"
#include "helicarm/case_registration/load.h"
#include "helicarm/registration/flat_cut.h"
#include "helicarm/registration/landmarks.h"
#include "helicarm/registration/prominent_points.h"
#include "helicarm/volume/tiff_stack.h"

namespace helicarm::gui {

using Eigen::Vector3d;
using pipeline::PointInModel;

namespace {

constexpr std::size_t most_proposed = 4;  // one more than a start needs

QString in_mm(double value) { return fixed(value, 1); }

/// The proposals lie apart from where the volume, or a mask within it, cuts the body.
std::vector<Vector3d> proposals_of(const registration::Model& model, const phantom::TriangleMesh& mesh) {
  std::vector<Vector3d> cuts = model.cuts;
  if (!model.surface)
    if (const auto surface = registration::prepare_surface(mesh, model.name)) {
      const std::vector<Vector3d> flat = registration::flat_cut(*surface);
      cuts.insert(cuts.end(), flat.begin(), flat.end());
    }
  std::vector<Vector3d> places;
  for (const auto& point : registration::prominent_points(mesh, cuts, {.most = most_proposed}))
    places.push_back(point.place);
  return places;
}

}  // namespace

LandmarksWindow::LandmarksWindow(Controller& controller, std::size_t model, QWidget* parent)
    : QDialog(parent), controller_(controller), model_(model) {
  const ApplicationState& state = controller.state();
  files_ = state.models.at(model);
  folder_ = state.folder;
  setObjectName("landmarks");
  setWindowTitle(tr("Landmarks in %1").arg(text(files_.name)));
  setWindowFlag(Qt::WindowMaximizeButtonHint);
  auto* column = new QVBoxLayout(this);
  says_ = new QLabel;
  says_->setObjectName("landmarksSay");
  says_->setWordWrap(true);
  column->addWidget(says_);
  auto* row = new QHBoxLayout;
  row->addWidget(build_views(files_.volume.has_value()), 3);
  row->addWidget(build_side(), 2);
  column->addLayout(row, 1);
  resize(1100, 720);
  connect(&controller_, &Controller::changed, this, &LandmarksWindow::show_state);
  connect(&controller_, &Controller::refused, this, [this](Phase phase, const QString& why) {
    if (phase == Phase::registration && !busy_) says_->setText(why);
  });
  load();
}

QWidget* LandmarksWindow::build_views(bool has_volume) {
  auto* views = new QWidget;
  auto* grid = new QGridLayout(views);
  grid->setContentsMargins(0, 0, 0, 0);
  surface_ = new SurfaceView;
  connect(surface_, &SurfaceView::placed, this, &LandmarksWindow::place);
  if (!has_volume) {
    grid->addWidget(surface_, 0, 0);
    return views;
  }
  for (int axis = 0; axis < 3; ++axis) {
    auto* slice = slices_[std::size_t(axis)] = new SliceView(axis);
    connect(slice, &SliceView::placed, this, [this](const Vector3d& voxel) {
      if (slices_scene_.ct) place(slices_scene_.ct->patient_from_voxel * voxel);
    });
  }
  grid->addWidget(slices_[2], 0, 0);
  grid->addWidget(slices_[1], 0, 1);
  grid->addWidget(slices_[0], 1, 0);
  grid->addWidget(surface_, 1, 1);
  for (int i = 0; i < 2; ++i) {
    grid->setRowStretch(i, 1);
    grid->setColumnStretch(i, 1);
  }
  return views;
}

QWidget* LandmarksWindow::build_side() {
  auto* side = new QWidget;
  auto* column = new QVBoxLayout(side);
  column->setContentsMargins(0, 0, 0, 0);
  at_ = new QLabel;
  at_->setObjectName("landmarksAt");
  column->addWidget(at_);
  table_ = list_table("modelLandmarkTable", tr("Landmarks in the model"));
  table_->setColumnCount(5);
  const bool has_patient_frame = files_.volume && !volume::is_tiff_stack(*files_.volume);
  const QStringList axes = has_patient_frame ? QStringList{tr("L, mm"), tr("P, mm"), tr("S, mm")}
                                             : QStringList{tr("x, mm"), tr("y, mm"), tr("z, mm")};
  table_->setHorizontalHeaderLabels(QStringList{tr("Landmark")} + axes + QStringList{tr("picked in")});
  table_->setSelectionBehavior(QAbstractItemView::SelectRows);
  table_->setSelectionMode(QAbstractItemView::SingleSelection);
  connect(table_, &QTableWidget::itemSelectionChanged, this, [this] {
    if (const auto name = chosen()) {
      const auto of_it = std::ranges::find(landmarks(), *name, &PointInModel::name);
      name_->setText(text(*name));
      if (of_it != landmarks().end()) place(of_it->in_model);
    }
    allow();
  });
  column->addWidget(table_, 1);
  build_buttons(column);
  return side;
}

void LandmarksWindow::build_buttons(QVBoxLayout* column) {
  name_ = new QLineEdit;
  name_->setObjectName("modelLandmarkName");
  name_->setPlaceholderText(tr("name"));
  name_->setAccessibleName(tr("Name of the landmark"));
  name_->setMaxLength(64);
  add_ = new QPushButton(tr("&Add at the cursor"));
  add_->setToolTip(tr("Of this name, in the model and as a point to click on page Plan"));
  move_ = new QPushButton(tr("&Move to the cursor"));
  move_->setToolTip(tr("The landmark selected in the table"));
  rename_ = new QPushButton(tr("Re&name"));
  rename_->setToolTip(tr("Gives the landmark selected in the table this name, with its picks"));
  remove_ = new QPushButton(tr("&Remove"));
  remove_->setToolTip(tr("The landmark selected in the table; its picks stay"));
  propose_ = new QPushButton(tr("&Propose"));
  propose_->setToolTip(
      tr("Adds up to four tips of the surface that stand out: keep those that the X-ray images "
         "show, and remove the others"));
  auto* close = new QPushButton(tr("&Close"));
  auto* of_name = new QHBoxLayout;
  for (QWidget* part : std::initializer_list<QWidget*>{name_, add_, rename_}) of_name->addWidget(part);
  auto* of_row = new QHBoxLayout;
  for (QWidget* part : std::initializer_list<QWidget*>{move_, remove_, propose_, close})
    of_row->addWidget(part);
  column->addLayout(of_name);
  column->addLayout(of_row);
  for (const auto& [button, name] : {std::pair(add_, "addModelLandmark"),
                                     {move_, "moveModelLandmark"},
                                     {rename_, "renameModelLandmark"},
                                     {remove_, "removeModelLandmark"},
                                     {propose_, "proposeLandmarks"},
                                     {close, "closeLandmarks"}}) {
    button->setObjectName(name);
    button->setAutoDefault(false);
  }
  connect(add_, &QPushButton::clicked, this, &LandmarksWindow::add);
  connect(name_, &QLineEdit::returnPressed, this, &LandmarksWindow::add);
  connect(name_, &QLineEdit::textChanged, this, &LandmarksWindow::allow);
  connect(move_, &QPushButton::clicked, this, &LandmarksWindow::move_to_cursor);
  connect(rename_, &QPushButton::clicked, this, &LandmarksWindow::rename);
  connect(remove_, &QPushButton::clicked, this, &LandmarksWindow::remove);
  connect(propose_, &QPushButton::clicked, this, &LandmarksWindow::propose);
  connect(close, &QPushButton::clicked, this, &QDialog::close);
  connect(new QShortcut(QKeySequence::Undo, this), &QShortcut::activated, &controller_, &Controller::undo);
  connect(new QShortcut(QKeySequence::Redo, this), &QShortcut::activated, &controller_, &Controller::redo);
}

LandmarksWindow::Loaded LandmarksWindow::loaded(const pipeline::CaseModel& model) {
  Loaded loaded;
  const auto say = [&](const Failure& failure) { loaded.told << sentence_of(failure); };
  const auto read = guarded([&] {
    try {
      if (const auto body = value_or_throw(case_registration::load_model(model)).model) {
        auto mesh = std::make_shared<const phantom::TriangleMesh>(surface_of(*body));
        loaded.proposals = proposals_of(*body, *mesh);
        loaded.mesh = std::move(mesh);
        for (const Warning& warning : body->warnings) say(warning);
      }
      if (model.volume) {
        loaded.ct =
            std::make_shared<const volume::Volume>(value_or_throw(case_registration::volume_of(model)));
        loaded.body = body_of(*loaded.ct, model);
      }
    } catch (const BadInput&) {
      throw;
    } catch (const std::exception& problem) {  // such as no memory
      throw BadInput(Reason::unsupported, problem.what());
    }
  });
  if (!read) say(read.error());
  if (const auto start = guarded([&] { return case_registration::start_landmarks(model); }); !start)
    say(start.error());
  return loaded;
}

/// In another thread, which does not outlast the program; the window may be closed meanwhile.
void LandmarksWindow::load() {
  busy_ = true;
  says_->setText(tr("The files of %1 are read.").arg(text(files_.name)));
  allow();
  QThreadPool::globalInstance()->start([self = QPointer<LandmarksWindow>(this), model = files_] {
    const auto done = std::make_shared<const Loaded>(loaded(model));
    QMetaObject::invokeMethod(
        qApp,
        [self, done] {
          if (self) self->take(*done);
        },
        Qt::QueuedConnection);
  });
}

void LandmarksWindow::take(const Loaded& loaded) {
  busy_ = false;
  told_ = loaded.told;
  proposals_ = loaded.proposals;
  slices_scene_.ct = loaded.ct;
  slices_scene_.body = loaded.body;
  if (loaded.ct) slices_scene_.cursor = 0.5 * (loaded.ct->size.cast<double>().array() - 1).matrix();
  surface_scene_.mesh = loaded.mesh;
  show_state();
}

const std::vector<PointInModel>& LandmarksWindow::landmarks() const {
  static const std::vector<PointInModel> none;
  const ModelLandmarks& all = controller_.state().model_landmarks;
  return model_ < all.size() ? all[model_] : none;
}

std::optional<std::string> LandmarksWindow::chosen() const {
  const int row = table_->currentRow();
  if (!table_->selectionModel()->hasSelection() || row < 0 || std::size_t(row) >= landmarks().size())
    return std::nullopt;
  return landmarks()[std::size_t(row)].name;
}

void LandmarksWindow::place(const Vector3d& in_model) {
  surface_scene_.cursor = in_model;
  if (slices_scene_.ct) slices_scene_.cursor = slices_scene_.ct->patient_from_voxel.inverse() * in_model;
  if (name_->text().isEmpty()) name_->setText(text(free_landmark_name(controller_.state(), model_, "L")));
  show_places();
  allow();
}

void LandmarksWindow::add() {
  const std::string name = name_->text().trimmed().toStdString();
  if (!add_->isEnabled()) return;
  if (std::ranges::find(landmarks(), name, &PointInModel::name) != landmarks().end())
    return says_->setText(
        tr("%1 has a landmark of this name already: move it, or give another name.").arg(text(files_.name)));
  table_->clearSelection();
  controller_.place_landmarks(model_, {{name, *cursor()}});
  const auto added = std::ranges::find(landmarks(), name, &PointInModel::name);
  if (added != landmarks().end()) name_->setText(text(free_landmark_name(controller_.state(), model_, "L")));
}

void LandmarksWindow::move_to_cursor() {
  if (const auto name = chosen(); name && cursor()) controller_.place_landmarks(model_, {{*name, *cursor()}});
}

void LandmarksWindow::rename() {
  if (const auto name = chosen())
    controller_.rename_landmark(model_, *name, name_->text().trimmed().toStdString());
}

void LandmarksWindow::remove() {
  if (const auto name = chosen()) controller_.remove_landmark(model_, *name);
}

/// Those that are not landmarks already.
void LandmarksWindow::propose() {
  constexpr double same_place_mm = 5;
  std::vector<PointInModel> points;
  int number = 1;
  for (const Vector3d& place : proposals_) {
    if (std::ranges::any_of(landmarks(), [&](const PointInModel& known) {
          return (known.in_model - place).norm() < same_place_mm;
        }))
      continue;
    const std::string name = free_landmark_name(controller_.state(), model_, "L", number);
    number = std::stoi(name.substr(1)) + 1;
    points.push_back({name, place});
  }
  if (!points.empty()) return controller_.place_landmarks(model_, points);
  says_->setText(
      proposals_.empty()
          ? tr("No part of the surface stands out: place landmarks where the X-ray images show them.")
          : tr("The points that stand out are landmarks already."));
}

void LandmarksWindow::show_state() {
  const ApplicationState& state = controller_.state();
  const bool is_its_case =
      state.folder == folder_ && model_ < state.models.size() && state.models[model_].name == files_.name;
  if (!is_its_case) {
    close();
    return;
  }
  if (busy_) return;
  fill_table();
  show_places();
  say_next();
  allow();
}

void LandmarksWindow::show_places() {
  surface_scene_.landmarks.clear();
  slices_scene_.seeds.clear();
  for (const PointInModel& point : landmarks()) {
    surface_scene_.landmarks.emplace_back(text(point.name), point.in_model);
    if (slices_scene_.ct)
      slices_scene_.seeds.emplace_back(text(point.name),
                                       slices_scene_.ct->patient_from_voxel.inverse() * point.in_model);
  }
  surface_->show_scene(surface_scene_);
  if (slices_scene_.ct)
    for (SliceView* slice : slices_) slice->show_scene(slices_scene_);
  QString words = tr("Click in a slice or on the surface.");
  if (cursor())
    words =
        tr("Cursor at %1, %2, %3 mm").arg(in_mm(cursor()->x()), in_mm(cursor()->y()), in_mm(cursor()->z()));
  at_->setText(words);
}

void LandmarksWindow::fill_table() {
  const ApplicationState& state = controller_.state();
  const QSignalBlocker quiet(table_);
  const QTableWidgetItem* current =
      table_->selectionModel()->hasSelection() ? table_->item(table_->currentRow(), 0) : nullptr;
  const QString selected = current ? current->text() : QString();
  const bool has_as_many = table_->rowCount() == int(landmarks().size());
  table_->setRowCount(int(landmarks().size()));
  for (int row = 0; row < table_->rowCount(); ++row) {
    const PointInModel& point = landmarks()[std::size_t(row)];
    const QStringList words{
        text(point.name), in_mm(point.in_model.x()), in_mm(point.in_model.y()), in_mm(point.in_model.z()),
        tr("%1 of %2 views").arg(views_with(state.picks, point.name)).arg(state.views.size())};
    for (int column = 0; column < words.size(); ++column)
      table_->setItem(row, column, list_cell(words[column]));
  }
  if (!current) return;
  const auto same = std::ranges::find(landmarks(), selected.toStdString(), &PointInModel::name);
  if (same != landmarks().end()) return table_->selectRow(int(same - landmarks().begin()));
  if (has_as_many) return;  // it has another name
  table_->clearSelection();
  name_->clear();
}

/// What the files said, and what comes next.
void LandmarksWindow::say_next() {
  QStringList words = told_;
  const ApplicationState& state = controller_.state();
  const auto unpicked = std::ranges::find_if(
      landmarks(), [&](const PointInModel& point) { return views_with(state.picks, point.name) < 2; });
  const QString start = tr("three landmarks that are picked in two X-ray images each start the registration");
  if (!surface_scene_.mesh && !slices_scene_.ct)
    words << tr("Nothing of %1 can be shown.").arg(text(files_.name));
  else if (landmarks().size() < registration::least_landmarks)
    words << tr("Place landmarks that the X-ray images show as well; %1.").arg(start);
  else if (count_usable(landmarks(), state.picks) >= registration::least_landmarks)
    words << tr("Register the models (Alt+7): %1.").arg(start);
  else
    words << tr("Click %1 in two X-ray images on page Plan; %2.").arg(text(unpicked->name), start);
  if (!controller_.takes_picks()) words << tr("During other work no landmark is changed.");
  says_->setText(words.join('\n'));
}

void LandmarksWindow::allow() {
  const bool is_free = !busy_ && controller_.takes_landmarks(model_);
  const bool has_name = !name_->text().trimmed().isEmpty();
  const bool is_chosen = chosen().has_value();
  add_->setEnabled(is_free && has_name && cursor());
  move_->setEnabled(is_free && is_chosen && cursor());
  rename_->setEnabled(is_free && is_chosen && has_name && name_->text().trimmed() != text(*chosen()));
  remove_->setEnabled(is_free && is_chosen);
  propose_->setEnabled(is_free && surface_scene_.mesh);
}

}  // namespace helicarm::gui
