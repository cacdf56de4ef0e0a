// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QDialog>
#include <array>
#include <functional>
#include <vector>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/core/field.h"
#include "helicarm/devices/receiver/receiver.h"
#include "helicarm/operation/plan.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/virtual_devices/virtual_devices.h"

class QTabWidget;

namespace helicarm::gui {

/// All options that have lists of fields.
struct Settings {
  pipeline::RunOptions run = {};
  case_registration::SearchRange search = {};
  operation::OperationPlan plan = {};
  receiver::ReceiverOptions receiver = {};
  virtual_devices::VirtualDevicesOptions virtual_or = {};
};

/// A page for each list of fields: label, box with unit and limits, tooltip.
class SettingsDialog : public QDialog {
  Q_OBJECT

 public:
  explicit SettingsDialog(Settings settings, QWidget* parent = nullptr);

  /// The options with the values of the boxes; always within the fields' limits.
  Settings settings() const;

 private:
  template <class Options, std::size_t count>
  void add_page(QTabWidget& pages, const QString& title, Options Settings::*part,
                const std::array<Field<Options>, count>& fields);

  Settings given_;
  std::vector<std::function<void(Settings&)>> readers_;
  std::vector<std::function<void()>> resetters_;
};

}  // namespace helicarm::gui
