// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/field_box.h"

#include <QCheckBox>
#include <QComboBox>
#include <QCoreApplication>
#include <QDoubleSpinBox>
#include <QHBoxLayout>
#include <cmath>

namespace helicarm::gui {
namespace {

QString text_of(std::string_view text) { return QString::fromUtf8(text.data(), qsizetype(text.size())); }

/// "2 mm", not "2.000000 mm".
class NumberBox : public QDoubleSpinBox {
 public:
  using QDoubleSpinBox::QDoubleSpinBox;
  QString textFromValue(double value) const override {
    return locale().toString(value, 'g', 12).remove(locale().groupSeparator());
  }
};

}  // namespace

QString FieldBox::tip(std::string_view help, const std::string& limits) {
  const QString translated = QCoreApplication::translate("Field", std::string(help).c_str());
  return tr("%1\nLimits: %2").arg(translated, QString::fromStdString(limits));
}

void FieldBox::build(Range range, std::string_view unit, std::span<const std::string_view> words,
                     bool may_be_unset) {
  auto* row = new QHBoxLayout(this);
  row->setContentsMargins(0, 0, 0, 0);
  QWidget* box = nullptr;
  if (!words.empty()) {
    box = words_ = new QComboBox(this);
    for (const std::string_view word : words) words_->addItem(text_of(word));
  } else {
    box = number_ = new NumberBox(this);
    number_->setDecimals(step_ > 0 ? 0 : 6);
    number_->setRange(range.low, range.high);
    if (step_ > 0)
      number_->setSingleStep(step_);
    else
      number_->setStepType(QAbstractSpinBox::AdaptiveDecimalStepType);
    if (!unit.empty()) number_->setSuffix(" " + text_of(unit));
    connect(number_, &QDoubleSpinBox::editingFinished, this,
            [this] { number_->setValue(value().value_or(low_)); });
  }
  if (may_be_unset) {
    tick_ = new QCheckBox(this);
    tick_->setAccessibleName(tr("Use"));
    row->addWidget(tick_);
    connect(tick_, &QCheckBox::toggled, box, &QWidget::setEnabled);
  }
  row->addWidget(box, 1);
  setFocusProxy(tick_ ? static_cast<QWidget*>(tick_) : box);
}

std::optional<double> FieldBox::value() const {
  if (tick_ && !tick_->isChecked()) return std::nullopt;
  if (words_) return words_->currentIndex();
  if (shown_ && number_->value() == *shown_) return given_;
  if (step_ == 0) return number_->value();
  return low_ + std::round((number_->value() - low_) / step_) * step_;
}

void FieldBox::set(std::optional<double> number) {
  if (tick_) {
    tick_->setChecked(number.has_value());
    (words_ ? static_cast<QWidget*>(words_) : number_)->setEnabled(number.has_value());
  }
  if (!number) {
    if (number_) number_->setValue(1);  // initial value after ticking
    return;
  }
  given_ = number;
  if (words_) return words_->setCurrentIndex(int(*number));
  number_->setValue(*number);
  shown_ = number_->value();
}

}  // namespace helicarm::gui
