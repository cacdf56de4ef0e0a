// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QWidget>
#include <optional>

#include "helicarm/core/field.h"

class QCheckBox;
class QComboBox;
class QDoubleSpinBox;

namespace helicarm::gui {

/// An editor for one number of a field: a spin box or a list of words, with a tick if it may be unset.
class FieldBox : public QWidget {
  Q_OBJECT

 public:
  template <class Options>
  FieldBox(const Field<Options>& field, const Options& options, QWidget* parent)
      : QWidget(parent), given_(field.get(options)), low_(field.range.low), step_(field.step) {
    build(field.range, field.unit, field.words, field.optional);
    setToolTip(tip(field.help, limits_of(field)));
    set(given_);
  }

  /// The displayed value, snapped to the field's steps; the given value, to the last bit, if it was not
  /// edited.
  std::optional<double> value() const;
  void set(std::optional<double> number);

 private:
  void build(Range range, std::string_view unit, std::span<const std::string_view> words, bool may_be_unset);
  static QString tip(std::string_view help, const std::string& limits);

  std::optional<double> given_;
  double low_, step_;
  QCheckBox* tick_ = nullptr;
  QComboBox* words_ = nullptr;
  QDoubleSpinBox* number_ = nullptr;
  std::optional<double> shown_;  ///< by the box for `given_`
};

}  // namespace helicarm::gui
