// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/measure_tool.h"

#include <algorithm>

namespace helicarm::gui {

ImageMeasure* MeasureTool::open() { return is_open_ ? &measures_.back() : nullptr; }

QString MeasureTool::hint() const {
  if (!kind_) return {};
  const measures::KindInfo& info = measures::info_of(*kind_);
  const auto words = [](std::string_view text) {
    return QString::fromUtf8(text.data(), static_cast<qsizetype>(text.size()));
  };
  const ImageMeasure fresh{0, *kind_, {}};
  const ImageMeasure& now = is_open_ ? measures_.back() : fresh;
  const QString name = words(info.label);
  if (const measures::Role* role = next_role(now)) {
    const QString where = tr("%1: click %2").arg(name, words(role->place));
    return role->is_optional ? tr("%1. Enter: without.").arg(where)
                             : tr("%1. Esc: leave the tool.").arg(where);
  }
  return info.further == measures::Further::rim
             ? tr("%1: click further points of the rim. Enter: done.").arg(name)
             : tr("%1: click points to be given in per cent. Enter: done.").arg(name);
}

void MeasureTool::begin(measures::Kind kind) {
  drop_unfinished();
  is_open_ = false;
  kind_ = kind;
  emit changed();
}

void MeasureTool::click(const std::string& image, const Eigen::Vector2d& raw) {
  if (!kind_) return;
  if (!is_open_) {
    measures_.push_back({++numbers_, *kind_, image});
    is_open_ = true;
  }
  ImageMeasure& now = measures_.back();
  if (now.image != image) return;
  const measures::Role* role = next_role(now);
  const std::size_t further = now.clicks.size() + 1 - required_clicks(now);
  const std::string name = role != nullptr ? std::string(role->word) : "point " + std::to_string(further);
  now.clicks.push_back({name, raw});
  is_open_ = takes_clicks(now);
  emit changed();
}

void MeasureTool::finish() {
  ImageMeasure* now = open();
  if (now == nullptr) return;
  const measures::Role* role = next_role(*now);
  if (role != nullptr && !role->is_optional) return;
  if (role != nullptr && measures::info_of(now->kind).roles[now->clicks.size() - 1].is_optional) return;
  if (role != nullptr)
    now->without_optional = true;
  else
    is_open_ = false;
  emit changed();
}

void MeasureTool::leave() {
  drop_unfinished();
  is_open_ = false;
  kind_.reset();
  emit changed();
}

void MeasureTool::drop_unfinished() {
  if (is_open_ && !is_complete(measures_.back())) measures_.pop_back();
}

void MeasureTool::move(int number, int click, const Eigen::Vector2d& raw) {
  const auto measure = std::ranges::find(measures_, number, &ImageMeasure::number);
  if (measure == measures_.end() || click < 0 || click >= std::ssize(measure->clicks)) return;
  measure->clicks[std::size_t(click)].raw = raw;
  emit changed();
}

void MeasureTool::remove(int number) {
  if (is_open_ && measures_.back().number == number) is_open_ = false;
  std::erase_if(measures_, [&](const ImageMeasure& one) { return one.number == number; });
  emit changed();
}

}  // namespace helicarm::gui
