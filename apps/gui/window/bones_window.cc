// SPDX-License-Identifier: Apache-2.0
#include "gui/window/bones_window.h"

#include <QApplication>
#include <QGridLayout>
#include <QHBoxLayout>
#include <QPointer>
#include <QThreadPool>
#include <QVBoxLayout>
#include <cmath>

#include "gui/controller/steps.h"
#include "gui/window/ask_files.h"
#include "gui/window/ct_body.h"
#include "gui/window/list_table.h"
#include "gui/xray/text.h"
#include "helicarm/case_registration/load.h"
#include "helicarm/segmentation/bones.h"
#include "helicarm/volume/read_volume.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

/// Below every threshold: none is set.
constexpr double no_threshold = -1001;

QString mm(const Eigen::Vector3d& at) {
  return QString("%1, %2, %3").arg(at.x(), 0, 'f', 1).arg(at.y(), 0, 'f', 1).arg(at.z(), 0, 'f', 1);
}

/// The CT with the model's body, and what is to be said.
struct OpenedCt {
  volume::Volume ct;
  CtBody body = {};
  QStringList told = {};
};

OpenedCt opened(const fs::path& file, const std::optional<pipeline::CaseModel>& model) {
  OpenedCt opened{value_or_throw(model ? case_registration::volume_of(*model) : volume::read_volume(file))};
  for (const Warning& warning : opened.ct.warnings) opened.told << sentence_of(warning);
  if (!model) return opened;
  opened.body = body_of(opened.ct, *model);
  if (opened.body.voxels)
    opened.told << BonesWindow::tr("The line around the model's body is named in each slice.");
  return opened;
}

}  // namespace

bool is_volume(const fs::path& file) {
  const QString name = text(file.filename().string()).toLower();
  for (const char* kind : {".nrrd", ".nhdr", ".mha", ".mhd", ".nii", ".nii.gz", ".hdr"})
    if (name.endsWith(kind)) return true;
  return false;
}

BonesWindow::BonesWindow(QWidget* parent) : QDialog(parent) {
  setObjectName("bones");
  setWindowFlag(Qt::WindowMaximizeButtonHint);
  auto* column = new QVBoxLayout(this);
  says_ = new QLabel;
  says_->setObjectName("bonesSay");
  says_->setWordWrap(true);
  column->addWidget(says_);
  auto* grid = new QGridLayout;
  for (int axis = 0; axis < 3; ++axis) {
    auto* slice = slices_[std::size_t(axis)] = new SliceView(axis);
    connect(slice, &SliceView::placed, this, &BonesWindow::place);
  }
  grid->addWidget(slices_[2], 0, 0);
  grid->addWidget(slices_[1], 0, 1);
  grid->addWidget(slices_[0], 1, 0);
  grid->addWidget(build_side(), 1, 1);
  for (int i = 0; i < 2; ++i) {
    grid->setRowStretch(i, 1);
    grid->setColumnStretch(i, 1);
  }
  column->addLayout(grid, 1);
  resize(1000, 720);
  allow();
}

BonesWindow::~BonesWindow() { *stopped_ = true; }

QWidget* BonesWindow::build_side() {
  auto* side = new QWidget;
  auto* column = new QVBoxLayout(side);
  column->setContentsMargins(0, 0, 0, 0);
  at_ = new QLabel;
  at_->setObjectName("bonesAt");
  column->addWidget(at_);
  auto* seed = new QHBoxLayout;
  name_ = new QLineEdit;
  name_->setObjectName("seedName");
  name_->setPlaceholderText(tr("bone"));
  name_->setAccessibleName(tr("Name of the bone at the cursor"));
  add_ = new QPushButton(tr("&Add seed"));
  remove_ = new QPushButton(tr("&Remove"));
  for (QWidget* part : std::initializer_list<QWidget*>{name_, add_, remove_}) seed->addWidget(part);
  column->addLayout(seed);
  table_ = list_table("seedTable", tr("Seeds"));
  table_->setColumnCount(4);
  table_->setHorizontalHeaderLabels({tr("Bone"), tr("HU"), tr("Volume, cm³"), tr("L, P, S, mm")});
  table_->setSelectionBehavior(QAbstractItemView::SelectRows);
  column->addWidget(table_, 1);
  auto* acts = new QHBoxLayout;
  threshold_ = new QDoubleSpinBox;
  threshold_->setObjectName("boneThreshold");
  threshold_->setAccessibleName(tr("Threshold of bone, HU"));
  threshold_->setToolTip(tr("Bone is what has at least this value; lowest: chosen by the CT"));
  threshold_->setRange(no_threshold, 30000);
  threshold_->setDecimals(0);
  threshold_->setSpecialValueText(tr("threshold by the CT"));
  threshold_->setSuffix(tr(" HU"));
  threshold_->setValue(no_threshold);
  find_ = new QPushButton(tr("&Find the bones"));
  cancel_ = new QPushButton(tr("&Cancel"));
  write_ = new QPushButton(tr("&Write..."));
  write_->setToolTip(tr("Mask and surface of each bone, segment.png and segment.json"));
  for (QWidget* part : std::initializer_list<QWidget*>{threshold_, find_, cancel_, write_})
    acts->addWidget(part);
  column->addLayout(acts);
  for (const auto& [button, name] : {std::pair(add_, "addSeed"),
                                     {remove_, "removeSeed"},
                                     {find_, "findBones"},
                                     {cancel_, "cancelBones"},
                                     {write_, "writeBones"}}) {
    button->setObjectName(name);
    button->setAutoDefault(false);
  }
  connect(add_, &QPushButton::clicked, this, &BonesWindow::add_seed);
  connect(name_, &QLineEdit::returnPressed, this, &BonesWindow::add_seed);
  connect(remove_, &QPushButton::clicked, this, &BonesWindow::remove_seed);
  connect(find_, &QPushButton::clicked, this, &BonesWindow::find_bones);
  connect(cancel_, &QPushButton::clicked, this, [this] { *stopped_ = true; });
  connect(write_, &QPushButton::clicked, this, &BonesWindow::ask_and_write);
  connect(table_, &QTableWidget::itemSelectionChanged, this, &BonesWindow::allow);
  connect(threshold_, &QDoubleSpinBox::valueChanged, this, &BonesWindow::seeds_changed);
  return side;
}

/// `work` runs in another thread, what it returns here afterwards.
void BonesWindow::run(const QString& doing, std::function<std::function<void()>()> work) {
  busy_ = true;
  *stopped_ = false;
  says_->setText(doing);
  allow();
  QThreadPool::globalInstance()->start([self = QPointer<BonesWindow>(this), work = std::move(work)] {
    const auto then = work();
    QMetaObject::invokeMethod(
        qApp,
        [self, then] {
          if (!self) return;
          self->busy_ = false;
          then();
          self->allow();
        },
        Qt::QueuedConnection);
  });
}

void BonesWindow::open_ct(const fs::path& file, CtPlan plan,
                          const std::optional<pipeline::CaseModel>& model) {
  file_ = file;
  plan_ = std::move(plan);
  setWindowTitle(tr("CT: %1").arg(text(file.filename().string())));
  run(tr("%1 is read.").arg(text(file.string())), [this, file, model] {
    auto read = std::make_shared<Expected<OpenedCt>>(guarded([&] { return opened(file, model); }));
    return [this, read] {
      if (!*read) return says_->setText(sentence_of(read->error()));
      scene_ = {};
      scene_.ct = std::make_shared<const volume::Volume>(std::move((*read)->ct));
      scene_.body = (*read)->body;
      scene_.plan = plan_;
      scene_.cursor = 0.5 * (scene_.ct->size.cast<double>().array() - 1).matrix();
      QStringList words = (*read)->told;
      if (!plan_.tunnels.empty()) {
        words << tr("The planned tunnels are dashed, dotted before the bone, projected onto each slice.");
        const CtTunnel& first = plan_.tunnels.front();
        const Eigen::Vector3d middle =
            scene_.ct->patient_from_voxel.inverse() * Eigen::Vector3d(0.5 * (first.start + first.end));
        const Eigen::Array3d last = (scene_.ct->size.array() - 1).cast<double>();
        scene_.cursor = middle.array().round().max(0).min(last).matrix();
      }
      words << tr("Click in a bone in each slice, name it and add it as a seed; then find the bones.");
      says_->setText(words.join('\n'));
      show_scene();
    };
  });
}

void BonesWindow::show_plan(CtPlan plan) {
  plan_ = scene_.plan = std::move(plan);
  if (scene_.ct) show_scene();
}

double BonesWindow::value_at(const Eigen::Vector3d& voxel) const {
  const Eigen::Vector3i at = voxel.array().round().cast<int>();
  const Eigen::Vector3i& size = scene_.ct->size;
  return double(scene_.ct->voxels[(std::size_t(at.z()) * std::size_t(size.y()) + std::size_t(at.y())) *
                                      std::size_t(size.x()) +
                                  std::size_t(at.x())]);
}

void BonesWindow::place(const Eigen::Vector3d& voxel) {
  scene_.cursor = voxel.array().round();
  show_scene();
}

void BonesWindow::show_scene() {
  scene_.seeds.clear();
  const Eigen::Affine3d voxel_from_patient = scene_.ct->patient_from_voxel.inverse();
  for (const segmentation::Seed& seed : seeds_)
    scene_.seeds.emplace_back(text(seed.name), voxel_from_patient * seed.point);
  for (SliceView* slice : slices_) slice->show_scene(scene_);
  at_->setText(tr("L, P, S: %1 mm; %2 HU")
                   .arg(mm(scene_.ct->patient_from_voxel * scene_.cursor))
                   .arg(value_at(scene_.cursor), 0, 'f', 0));
}

void BonesWindow::add_seed() {
  if (!scene_.ct || busy_) return;
  const std::string name = name_->text().trimmed().toStdString();
  if (const auto good = segmentation::check_name(name); !good)
    return says_->setText(sentence_of(good.error()));
  if (std::ranges::any_of(seeds_, [&](const auto& other) { return other.name == name; }))
    return says_->setText(tr("There is a seed of this name already."));
  seeds_.push_back({name, scene_.ct->patient_from_voxel * scene_.cursor});
  name_->clear();
  seeds_changed();
}

void BonesWindow::remove_seed() {
  const int row = table_->currentRow();
  if (row < 0 || std::size_t(row) >= seeds_.size()) return;
  seeds_.erase(seeds_.begin() + row);
  seeds_changed();
}

/// The bones found are not of the present seeds.
void BonesWindow::seeds_changed() {
  found_.reset();
  scene_.labels.reset();
  if (!scene_.ct) return;
  says_->setText(seeds_.empty() ? tr("Click in a bone, name it and add it as a seed.")
                                : tr("Find the bones at the seeds."));
  fill_table();
  show_scene();
  allow();
}

void BonesWindow::fill_table() {
  table_->setRowCount(int(seeds_.size()));
  const Eigen::Affine3d voxel_from_patient = scene_.ct->patient_from_voxel.inverse();
  for (int row = 0; row < table_->rowCount(); ++row) {
    const segmentation::Seed& seed = seeds_[std::size_t(row)];
    QString volume = "–";
    if (found_)
      for (const segmentation::Bone& bone : found_->segmentation.bones)
        if (bone.name == seed.name) volume = fixed(bone.volume_cm3, 1);
    const QStringList words{text(seed.name), fixed(value_at(voxel_from_patient * seed.point), 0), volume,
                            mm(seed.point)};
    for (int column = 0; column < words.size(); ++column)
      table_->setItem(row, column, list_cell(words[column]));
  }
}

void BonesWindow::find_bones() {
  segmentation::SegmentOptions options;
  if (threshold_->value() > no_threshold) options.threshold_hu = threshold_->value();
  run(tr("The bones are found."),
      [this, ct = scene_.ct, seeds = seeds_, options, file = file_, stopped = stopped_] {
        const auto check = [stopped] {
          if (*stopped) throw BadInput(Reason::interrupted, "cancelled");
        };
        const auto done = guarded([&]() -> std::shared_ptr<const segmentation::SegmentAnswer> {
          auto answer = std::make_shared<segmentation::SegmentAnswer>();
          answer->segmentation = value_or_throw(segmentation::segment(
              *ct, seeds, options, {.stage = [&](std::string_view) { check(); }, .view = check}));
          answer->ct_name = file.filename().string();
          answer->inputs = {file};
          answer->ct = *ct;
          answer->options = options;
          return answer;
        });
        return [this, done] { show_bones(done); };
      });
}

void BonesWindow::show_bones(const Expected<std::shared_ptr<const segmentation::SegmentAnswer>>& done) {
  if (!done) return says_->setText(sentence_of(done.error()));
  found_ = *done;
  scene_.labels = std::make_shared<const std::vector<std::uint8_t>>(found_->segmentation.labels);
  QStringList words{tr("%n bones found; check their colour in all slices.", nullptr,
                       int(found_->segmentation.bones.size()))};
  for (const auto* list : {&found_->segmentation.warnings, &found_->segmentation.notes})
    for (const Warning& each : *list) words << sentence_of(each);
  says_->setText(words.join('\n'));
  fill_table();
  show_scene();
}

void BonesWindow::ask_and_write() {
  ask_files(this, tr("Folder for masks and surfaces"), QFileDialog::Directory, {},
            [this](const std::vector<fs::path>& chosen) {
              if (!found_ || busy_) return;
              run(tr("Masks and surfaces are written."), [this, found = found_, folder = chosen.front()] {
                const auto written = segmentation::write_segmentation(*found, folder);
                const QString words =
                    written ? tr("Written to %1.").arg(text(folder.string())) : sentence_of(written.error());
                return [this, words] { says_->setText(words); };
              });
            });
}

void BonesWindow::allow() {
  const bool is_free = scene_.ct && !busy_;
  for (QWidget* part : std::initializer_list<QWidget*>{name_, add_, threshold_}) part->setEnabled(is_free);
  remove_->setEnabled(is_free && table_->currentRow() >= 0 && !seeds_.empty());
  find_->setEnabled(is_free && !seeds_.empty());
  cancel_->setEnabled(busy_);
  write_->setEnabled(is_free && found_ != nullptr);
}

}  // namespace helicarm::gui
