// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/settings_dialog.h"

#include <QCoreApplication>
#include <QDialogButtonBox>
#include <QFormLayout>
#include <QPushButton>
#include <QTabBar>
#include <QTabWidget>
#include <QVBoxLayout>
#include <algorithm>

#include "gui/replay/field_box.h"
#include "helicarm/case_registration/register_fields.h"
#include "helicarm/devices/receiver/receiver_fields.h"
#include "helicarm/operation/plan_fields.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/virtual_devices/virtual_devices_fields.h"

namespace helicarm::gui {

template <class Options, std::size_t count>
void SettingsDialog::add_page(QTabWidget& pages, const QString& title, Options Settings::*part,
                              const std::array<Field<Options>, count>& fields) {
  auto* page = new QWidget(&pages);
  auto* form = new QFormLayout(page);
  for (const Field<Options>& field : fields) {
    auto* box = new FieldBox(field, given_.*part, page);
    box->setObjectName(QString::fromUtf8(field.name.data(), qsizetype(field.name.size())));
    form->addRow(QCoreApplication::translate("Field", label_of(field).c_str()), box);
    form->labelForField(box)->setToolTip(box->toolTip());
    for (QWidget* entry : box->findChildren<QWidget*>(QString(), Qt::FindDirectChildrenOnly))
      if (entry->accessibleName().isEmpty())
        entry->setAccessibleName(QCoreApplication::translate("Field", label_of(field).c_str()));
    readers_.push_back([&field, box, part](Settings& settings) { field.set(settings.*part, box->value()); });
    resetters_.push_back([&field, box] { box->set(field.get(Options{})); });
  }
  pages.addTab(page, title);
}

SettingsDialog::SettingsDialog(Settings settings, QWidget* parent)
    : QDialog(parent), given_(std::move(settings)) {
  setWindowTitle(tr("Settings"));
  setObjectName("settings");
  auto* pages = new QTabWidget(this);
  pages->setUsesScrollButtons(false);  // larger text widens the dialog
  add_page(*pages, tr("&Measurement"), &Settings::run, pipeline::run_fields);
  add_page(*pages, tr("R&egistration"), &Settings::search, case_registration::search_fields);
  add_page(*pages, tr("&Operation"), &Settings::plan, operation::plan_fields);
  add_page(*pages, tr("&Receiver"), &Settings::receiver, receiver::receiver_fields);
  add_page(*pages, tr("&Virtual devices"), &Settings::virtual_or, virtual_devices::virtual_devices_fields);
  auto* buttons = new QDialogButtonBox(
      QDialogButtonBox::Ok | QDialogButtonBox::Cancel | QDialogButtonBox::RestoreDefaults, this);
  connect(buttons, &QDialogButtonBox::accepted, this, &QDialog::accept);
  connect(buttons, &QDialogButtonBox::rejected, this, &QDialog::reject);
  connect(buttons->button(QDialogButtonBox::RestoreDefaults), &QPushButton::clicked, this, [this] {
    for (const auto& reset : resetters_) reset();
  });
  auto* all = new QVBoxLayout(this);
  all->addWidget(pages);
  all->addWidget(buttons);
  resize(std::max(sizeHint().width(), pages->tabBar()->sizeHint().width() + 60), sizeHint().height());
}

Settings SettingsDialog::settings() const {
  Settings settings = given_;
  for (const auto& read : readers_) read(settings);
  return settings;
}

}  // namespace helicarm::gui
