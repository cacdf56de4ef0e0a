// SPDX-License-Identifier: Apache-2.0
#include "gui/window/new_case_dialog.h"

#include <QApplication>
#include <QEvent>
#include <QMenu>
#include <QPointer>
#include <QSignalBlocker>
#include <QSpinBox>
#include <QThreadPool>
#include <algorithm>
#include <functional>

#include "gui/controller/steps.h"
#include "gui/window/ask_files.h"
#include "gui/window/new_case_parts.h"
#include "gui/window/style.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

void show_lack(QLabel* label, const std::string& words) {
  label->setText(text(words));
  label->setVisible(!words.empty());
}

QString words_of(const ViewPlate& plate) {
  if (plate.map) return QObject::tr("map: %1").arg(name_of(*plate.map));
  if (plate.plate_image) return QObject::tr("plate: %1").arg(name_of(*plate.plate_image));
  return QObject::tr("in the image");
}

}  // namespace

bool NewCaseDialog::event(QEvent* event) {
  constexpr int narrowest = 860;
  const bool done = QDialog::event(event);
  if (layout() == nullptr) return done;
  if (event->type() == QEvent::StyleChange) setMinimumWidth(style::scaled(narrowest));
  if (event->type() == QEvent::LayoutRequest || event->type() == QEvent::Resize)
    setMinimumHeight(layout()->totalMinimumHeightForWidth(width()));
  return done;
}

void NewCaseDialog::add_images(const std::vector<pipeline::NewImage>& images) {
  for (const pipeline::NewImage& image : images) {
    const auto has = std::ranges::find(draft_.images, image.file, &CaseDraft::Image::file);
    if (has == draft_.images.end()) draft_.images.push_back({image, {}, ++last_number_});
  }
  changed();
}

void NewCaseDialog::choose_frame(const fs::path& file, int frame) {
  if (std::ranges::count(draft_.images, file, &CaseDraft::Image::file) != 1) return;
  const auto image = std::ranges::find(draft_.images, file, &CaseDraft::Image::file);
  if (image->frame == frame) return;
  image->frame = frame;
  changed();
}

void NewCaseDialog::ask_images() {
  ask_files(this, tr("X-ray images"), QFileDialog::ExistingFiles, {},
            [this](const std::vector<fs::path>& chosen) {
              for (const fs::path& file : chosen)
                draft_.images.push_back({{file}, {}, ++last_number_});  // or another frame
              changed();
            });
}

void NewCaseDialog::remove_chosen() {
  std::set<int, std::greater<>> rows;
  for (const QModelIndex& row : table_->selectionModel()->selectedRows()) rows.insert(row.row());
  for (const int row : rows) draft_.images.erase(draft_.images.begin() + row);
  table_->clearSelection();
  changed();
}

void NewCaseDialog::ask_folder() {
  ask_files(this, tr("Folder of the case"), QFileDialog::Directory, {},
            [this](const std::vector<fs::path>& chosen) {
              own_folder_ = true;
              folder_->setText(text(chosen.front().string()));
            });
}

void NewCaseDialog::changed() {
  if (filling_ || create_ == nullptr) return;
  draft_.calibrator = calibrator_->currentData().toString().toStdString();
  draft_.plate.reset();
  if (plate_->currentIndex() > 0) draft_.plate = plate_->currentData().toString().toStdString();
  draft_.c_arm = preset_->currentText().trimmed().toStdString();
  draft_.intensifier = intensifier_->text().trimmed().toStdString();
  if (!own_folder_) {
    const QSignalBlocker quiet(folder_);
    folder_->setText(draft_.images.empty() ? QString()
                                           : text(folder_beside(draft_.images.front().file).string()));
  }
  draft_.folder = folder_->text().trimmed().toStdString();
  checked_.images.resize(draft_.images.size());
  create_->setEnabled(false);
  show_rows();
  check();
}

void NewCaseDialog::check() {
  again_ = checking_;
  if (checking_) return;
  checking_ = true;
  findings_->setText(tr("Looking at the images..."));
  QThreadPool::globalInstance()->start(
      [self = QPointer<NewCaseDialog>(this), checker = checker_, draft = draft_] {
        const CheckedDraft checked = checker->check(draft);
        QMetaObject::invokeMethod(
            qApp,
            [self, checked] {
              if (self) self->take(checked);
            },
            Qt::QueuedConnection);
      });
}

void NewCaseDialog::take(const CheckedDraft& checked) {
  checking_ = false;
  if (std::exchange(again_, false)) return check();
  checked_ = checked;
  give_preset_files();
  show_rows();
  show_lack(images_lack_, checked_.images_lack);
  show_lack(calibrator_lacks_, checked_.calibrator_lacks);
  show_lack(plate_lacks_, checked_.plate_lacks);
  show_lack(folder_lacks_, checked_.folder_lacks);
  const bool decided = checked_.plate.plate.has_value();
  plate_->setItemText(
      0, decided ? tr("By the images: %1 (%2)").arg(text(*checked_.plate.plate), text(checked_.plate.why))
                 : tr("By the images"));
  show_findings();
  create_->setEnabled(checked_.is_complete() && !writing_);
}

void NewCaseDialog::show_rows() {
  filling_ = true;
  table_->setRowCount(int(draft_.images.size()));
  for (int row = 0; row < table_->rowCount(); ++row) show_row(row);
  filling_ = false;
}

void NewCaseDialog::show_row(int row) {
  const CaseDraft::Image& image = draft_.images[std::size_t(row)];
  const CheckedDraft::Image& checked = checked_.images[std::size_t(row)];
  const auto cell = [&](ImageColumn column, const QString& words, bool editable = false) {
    auto* item = table_->item(row, column);
    if (item == nullptr) table_->setItem(row, column, item = new QTableWidgetItem);
    item->setText(words);
    item->setFlags(Qt::ItemIsSelectable | Qt::ItemIsEnabled |
                   (editable ? Qt::ItemIsEditable : Qt::NoItemFlags));
    return item;
  };
  cell(file_column, name_of(image.file))->setToolTip(text(image.file.string()));
  cell(view_column, text(image.view.empty() ? checked.view : image.view), true);
  auto* found = cell(found_column, checked.failure ? sentence_of(*checked.failure) : text(checked.found));
  found->setToolTip(found->text());
  found->setForeground(checked.failure ? QBrush(style::colours().red) : QBrush());
  show_frame(row);
  show_view_plate(row);
}

void NewCaseDialog::show_frame(int row) {
  const CheckedDraft::Image& checked = checked_.images[std::size_t(row)];
  if (checked.frames <= 1) return table_->removeCellWidget(row, frame_column);
  auto* frame = qobject_cast<QSpinBox*>(table_->cellWidget(row, frame_column));
  if (frame == nullptr) {
    table_->setCellWidget(row, frame_column, frame = new QSpinBox);
    frame->setKeyboardTracking(false);
    connect(frame, &QSpinBox::valueChanged, this, [this, frame](int number) {
      const int at = table_->indexAt(frame->pos()).row();
      if (filling_ || at < 0) return;
      draft_.images[std::size_t(at)].frame = number;
      changed();
    });
  }
  frame->setRange(1, checked.frames);
  frame->setSuffix(tr(" of %1").arg(checked.frames));
  frame->setValue(draft_.images[std::size_t(row)].frame.value_or(checked.frame.value_or(1)));
}

QPushButton* NewCaseDialog::view_plate_button() {
  auto* button = new QPushButton;
  button->setStyleSheet("padding: 2px 8px;");
  button->setAutoDefault(false);
  const auto number = [this, button] {
    const int row = table_->indexAt(button->pos()).row();
    return row >= 0 && std::size_t(row) < draft_.images.size() ? draft_.images[std::size_t(row)].number : 0;
  };
  auto* menu = new QMenu(button);
  menu->addAction(tr("The plate in the image, or no plate"), this,
                  [this, number] { set_view_plate(number(), {}); });
  menu->addAction(tr("An image of the plate alone..."), this, [this, number] {
    ask_files(this, tr("Image of the plate"), QFileDialog::ExistingFile, {},
              [this, of = number()](const std::vector<fs::path>& chosen) {
                set_view_plate(of, {chosen.front(), {}});
              });
  });
  menu->addAction(tr("A distortion map..."), this, [this, number] {
    ask_files(this, tr("Distortion map"), QFileDialog::ExistingFile, tr("JSON (*.json)"),
              [this, of = number()](const std::vector<fs::path>& chosen) {
                set_view_plate(of, {{}, chosen.front()});
              });
  });
  button->setMenu(menu);
  return button;
}

void NewCaseDialog::show_view_plate(int row) {
  auto* button = qobject_cast<QPushButton*>(table_->cellWidget(row, plate_column));
  if (button == nullptr) table_->setCellWidget(row, plate_column, button = view_plate_button());
  button->setText(words_of(draft_.images[std::size_t(row)].plate));
}

void NewCaseDialog::set_view_plate(int number, const ViewPlate& plate) {
  const auto image = std::ranges::find(draft_.images, number, &CaseDraft::Image::number);
  if (image == draft_.images.end()) return;  // removed meanwhile
  image->plate = plate;
  changed();
}

void NewCaseDialog::show_findings() {
  QStringList lines;
  if (checked_.made && !*checked_.made) lines << sentence_of(checked_.made->error());
  if (checked_.is_complete()) {
    for (const Warning& warning : (*checked_.made)->warnings) lines << tr("Warning: ") + sentence_of(warning);
    lines << tr("Ready: %1 views, %2.")
                 .arg(checked_.images.size())
                 .arg(text((*checked_.made)->findings[checked_.images.size()]));
  }
  findings_->setText(lines.join("\n"));
}

void NewCaseDialog::create() {
  writing_ = true;
  create_->setEnabled(false);
  findings_->setText(tr("Writing the case..."));
  QThreadPool::globalInstance()->start(
      [self = QPointer<NewCaseDialog>(this), checker = checker_, draft = draft_] {
        const auto written = checker->write(draft);
        QMetaObject::invokeMethod(
            qApp,
            [self, written, folder = draft.folder] {
              if (!self) return;
              self->writing_ = false;
              if (!written) {
                self->findings_->setText(sentence_of(written.error()));
                return self->create_->setEnabled(true);
              }
              emit self->created(folder);
              self->accept();
            },
            Qt::QueuedConnection);
      });
}

void NewCaseDialog::list_presets(const QString& chosen) {
  const QSignalBlocker quiet(preset_);
  preset_->clear();
  for (const CArmPreset& preset : c_arm_presets(QSettings())) preset_->addItem(text(preset.name));
  preset_->setCurrentIndex(preset_->findText(chosen));
  preset_->setEditText(chosen);
  delete_preset_->setEnabled(preset_->count() > 0);
}

void NewCaseDialog::take_preset(const QString& name) {
  for (const CArmPreset& preset : c_arm_presets(QSettings())) {
    if (preset.name != name.toStdString()) continue;
    choose(calibrator_, text(preset.calibrator));
    choose(plate_, preset.plate ? QVariant(text(*preset.plate)) : QVariant());
    intensifier_->setText(text(preset.intensifier));
  }
  given_.clear();
  changed();
}

void NewCaseDialog::give_preset_files() {
  if (checked_.images.size() != draft_.images.size()) return;
  bool given = false;
  for (const CArmPreset& preset : c_arm_presets(QSettings())) {
    if (preset.name != draft_.c_arm) continue;
    for (std::size_t i = 0; i < draft_.images.size(); ++i) {
      const auto of_view = preset.views.find(checked_.images[i].view);
      if (of_view == preset.views.end() || !given_.insert(of_view->first).second) continue;
      draft_.images[i].plate = of_view->second;
      given = true;
    }
  }
  if (given) changed();
}

void NewCaseDialog::save_preset() {
  CArmPreset preset{draft_.c_arm, draft_.intensifier, draft_.calibrator, draft_.plate, {}};
  if (preset.name.empty()) return preset_->setFocus();
  for (std::size_t i = 0; i < draft_.images.size(); ++i)
    if (draft_.images[i].plate != ViewPlate{} && !checked_.images[i].view.empty())
      preset.views[checked_.images[i].view] = draft_.images[i].plate;
  QSettings settings;
  keep_preset(settings, preset);
  list_presets(text(preset.name));
}

void NewCaseDialog::delete_preset() {
  QSettings settings;
  forget_preset(settings, draft_.c_arm);
  list_presets({});
  changed();
}

}  // namespace helicarm::gui
