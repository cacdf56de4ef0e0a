// SPDX-License-Identifier: Apache-2.0
// The parts of the dialog.
#include "gui/window/new_case_parts.h"

#include <QFormLayout>
#include <QHBoxLayout>
#include <QHeaderView>
#include <QVBoxLayout>

#include "gui/window/ask_files.h"
#include "gui/window/new_case_dialog.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

QLabel* lack_label(const char* name) {
  auto* label = new QLabel;
  label->setObjectName(name);
  label->setWordWrap(true);
  label->setProperty("class", "attention");
  label->hide();
  return label;
}

}  // namespace

NewCaseDialog::NewCaseDialog(QWidget* parent) : QDialog(parent) {
  setWindowTitle(tr("New case of X-ray images"));
  auto* column = new QVBoxLayout(this);
  column->addWidget(build_preset_row());
  column->addWidget(build_images(), 1);
  column->addWidget(build_choices());
  column->addWidget(build_end());
  resize(980, 640);
  for (QPushButton* button : findChildren<QPushButton*>()) button->setAutoDefault(false);
  list_presets({});
  changed();
}

QWidget* NewCaseDialog::build_preset_row() {
  auto* part = new QWidget;
  auto* row = new QHBoxLayout(part);
  row->setContentsMargins(0, 0, 0, 0);
  preset_ = new QComboBox;
  preset_->setObjectName("cArm");
  preset_->setEditable(true);
  preset_->setInsertPolicy(QComboBox::NoInsert);
  preset_->lineEdit()->setPlaceholderText(tr("name of the C-arm"));
  preset_->setAccessibleName(tr("Name of the C-arm"));
  preset_->lineEdit()->setAccessibleName(preset_->accessibleName());
  preset_->setToolTip(tr("Calibrator, plate, maps and detector are kept under this name for further cases"));
  intensifier_ = new QLineEdit;
  intensifier_->setObjectName("intensifier");
  intensifier_->setAccessibleName(tr("Intensifier or detector"));
  intensifier_->setPlaceholderText(tr("intensifier or detector, e.g. 31 cm, field 2"));
  auto* save = new QPushButton(tr("&Keep preset"));
  save->setObjectName("keepPreset");
  delete_preset_ = new QPushButton(tr("&Delete preset"));
  delete_preset_->setObjectName("deletePreset");
  row->addWidget(new QLabel(tr("C-arm")));
  row->addWidget(preset_, 2);
  row->addWidget(intensifier_, 3);
  row->addWidget(save);
  row->addWidget(delete_preset_);
  connect(preset_, &QComboBox::textActivated, this, &NewCaseDialog::take_preset);
  connect(preset_, &QComboBox::editTextChanged, this, &NewCaseDialog::changed);
  connect(intensifier_, &QLineEdit::textChanged, this, &NewCaseDialog::changed);
  connect(save, &QPushButton::clicked, this, &NewCaseDialog::save_preset);
  connect(delete_preset_, &QPushButton::clicked, this, &NewCaseDialog::delete_preset);
  return part;
}

QWidget* NewCaseDialog::build_images() {
  auto* part = new QWidget;
  auto* column = new QVBoxLayout(part);
  column->setContentsMargins(0, 0, 0, 0);
  table_ = new QTableWidget(0, image_columns);
  table_->setObjectName("caseImages");
  table_->setAccessibleName(tr("Images of the case"));
  table_->setHorizontalHeaderLabels({tr("File"), tr("Frame"), tr("View"), tr("Distortion by"), tr("Found")});
  table_->horizontalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);
  table_->horizontalHeader()->setSectionResizeMode(found_column, QHeaderView::Stretch);
  table_->verticalHeader()->hide();
  table_->verticalHeader()->setMinimumSectionSize(34);
  table_->verticalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);  // what was found wraps
  table_->setSelectionBehavior(QAbstractItemView::SelectRows);
  column->addWidget(table_, 1);
  connect(table_, &QTableWidget::itemChanged, this, [this](const QTableWidgetItem* item) {
    if (filling_ || item->column() != view_column) return;
    draft_.images[std::size_t(item->row())].view = item->text().trimmed().toStdString();
    changed();
  });
  auto* row = new QHBoxLayout;
  auto* add = new QPushButton(tr("&Add images..."));
  add->setObjectName("addImages");
  auto* remove = new QPushButton(tr("&Remove selected"));
  remove->setObjectName("removeImage");
  row->addWidget(add);
  row->addWidget(remove);
  images_lack_ = lack_label("imagesLack");
  row->addWidget(images_lack_);
  row->addStretch(1);
  column->addLayout(row);
  connect(add, &QPushButton::clicked, this, &NewCaseDialog::ask_images);
  connect(remove, &QPushButton::clicked, this, &NewCaseDialog::remove_chosen);
  return part;
}

QComboBox* NewCaseDialog::add_choice(QFormLayout* form, const QString& title, const char* name,
                                     QLabel*& lack) {
  auto* row = new QHBoxLayout;
  auto* list = new QComboBox;
  list->setObjectName(name);
  auto* file = new QPushButton(tr("File..."));
  row->addWidget(list, 1);
  row->addWidget(file);
  form->addRow(title, row);
  lack = lack_label(qPrintable(QString(name) + "Lack"));
  form->addRow(lack);
  connect(list, &QComboBox::currentIndexChanged, this, &NewCaseDialog::changed);
  connect(file, &QPushButton::clicked, this, [this, list, title] {
    ask_files(this, title, QFileDialog::ExistingFile, tr("JSON (*.json)"),
              [list](const std::vector<fs::path>& chosen) { choose(list, text(chosen.front().string())); });
  });
  return list;
}

QWidget* NewCaseDialog::build_choices() {
  auto* part = new QWidget;
  auto* form = new QFormLayout(part);
  form->setContentsMargins(0, 0, 0, 0);
  calibrator_ = add_choice(form, tr("Calibrator"), "calibrator", calibrator_lacks_);
  calibrator_->addItem(tr("Choose..."), QString());
  calibrator_->addItem(tr("udcsc (built in: twelve balls of 4 mm on a cone)"), "udcsc");
  plate_ = add_choice(form, tr("Plate"), "plate", plate_lacks_);
  plate_->addItem(tr("By the images"), QVariant());
  plate_->addItem(tr("plate48 (built in: 48 balls of 2.5 mm, pitch 25 mm)"), "plate48");
  plate_->addItem(tr("none: flat panel, or images free of distortion"), "none");
  auto* row = new QHBoxLayout;
  folder_ = new QLineEdit;
  folder_->setObjectName("caseFolder");
  folder_->setAccessibleName(tr("Folder of the case"));
  auto* browse = new QPushButton(tr("Folder..."));
  row->addWidget(folder_, 1);
  row->addWidget(browse);
  form->addRow(tr("Write to"), row);
  folder_lacks_ = lack_label("folderLack");
  form->addRow(folder_lacks_);
  connect(folder_, &QLineEdit::textChanged, this, &NewCaseDialog::changed);
  connect(folder_, &QLineEdit::textEdited, this, [this] { own_folder_ = true; });
  connect(browse, &QPushButton::clicked, this, &NewCaseDialog::ask_folder);
  return part;
}

QWidget* NewCaseDialog::build_end() {
  auto* part = new QWidget;
  auto* column = new QVBoxLayout(part);
  column->setContentsMargins(0, 0, 0, 0);
  findings_ = new QLabel;
  findings_->setObjectName("findings");
  findings_->setWordWrap(true);
  findings_->setTextInteractionFlags(Qt::TextSelectableByMouse);
  column->addWidget(findings_);
  auto* row = new QHBoxLayout;
  auto* note = new QLabel(tr("Images outside the folder are copied unchanged, with their patient data."));
  note->setWordWrap(true);
  create_ = new QPushButton(tr("&Write and measure the case"));
  create_->setObjectName("createCase");
  auto* cancel = new QPushButton(tr("&Cancel"));
  row->addWidget(note, 1);
  row->addWidget(create_);
  row->addWidget(cancel);
  column->addLayout(row);
  connect(create_, &QPushButton::clicked, this, &NewCaseDialog::create);
  connect(cancel, &QPushButton::clicked, this, &QDialog::reject);
  return part;
}

}  // namespace helicarm::gui
