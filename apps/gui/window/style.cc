// SPDX-License-Identifier: Apache-2.0
#include "gui/window/style.h"

#include <QApplication>
#include <algorithm>

namespace helicarm::gui::style {
namespace {

const Colours dark{.ground{20, 24, 29},
                   .panel{30, 36, 43},
                   .raised{42, 50, 60},
                   .pressed{53, 64, 76},
                   .chosen{53, 80, 107},
                   .line{70, 80, 92},
                   .disabled{102, 112, 123},
                   .text{232, 236, 241},
                   .quiet{150, 161, 173},
                   .blue{86, 180, 233},
                   .green{64, 200, 130},
                   .amber{255, 196, 0},
                   .red{255, 115, 115},
                   .selected{28, 55, 82}};

const Colours light{.ground{240, 243, 246},
                    .panel{255, 255, 255},
                    .raised{225, 231, 238},
                    .pressed{207, 216, 226},
                    .chosen{176, 208, 236},
                    .line{160, 171, 182},
                    .disabled{128, 138, 148},
                    .text{20, 28, 36},
                    .quiet{76, 88, 100},
                    .blue{0, 96, 160},
                    .green{0, 110, 60},
                    .amber{140, 84, 0},
                    .red{190, 24, 24},
                    .selected{208, 226, 246}};

Appearance& current() {
  static Appearance appearance;
  return appearance;
}

constexpr const char* rules = R"(
    * { font-size: @textpx; color: @text; }
    QMainWindow, QDialog, QWidget { background: @ground; }
    QToolTip { background: @raised; border: 1px solid @line; padding: 4px; }
    QGroupBox { border: 1px solid @line; border-radius: 6px; margin-top: 10px; padding: 8px 6px 6px 6px; }
    QGroupBox::title { subcontrol-origin: margin; left: 10px; color: @quiet; }
    QLabel[class="attention"] { color: @amber; font-weight: bold; }
    QLabel[class="quiet"] { color: @quiet; }
    QLabel[class="recording"] { color: @red; }
    QPushButton { background: @raised; border: 1px solid @line; border-radius: 5px; padding: 7px 12px; }
    QPushButton:hover { background: @pressed; }
    QPushButton:checked, QToolButton:checked { background: @chosen; }
    QPushButton:focus { border: 2px solid @text; }
    QPushButton:disabled { color: @disabled; background: @panel; }
    QPushButton[class="hold"] { border: 1px solid @amber; }
    QPushButton[class="hold"]:disabled { border: 1px solid @line; }
    QPushButton[class="stop"] { background: #c81e1e; border: 2px solid #ff8080; color: white; font-size: @stoppx;
                                font-weight: bold; padding: 10px 22px; }
    QPushButton[class="stop"]:pressed { background: #a01010; }
    QTableWidget, QListWidget, QPlainTextEdit, QLineEdit, QComboBox {
      background: @panel; border: 1px solid @line; border-radius: 4px; padding: 3px; }
    QTableWidget, QListWidget { selection-background-color: @selected; }
    QPlainTextEdit, QLineEdit, QComboBox { selection-background-color: @chosen; selection-color: @text; }
    QSpinBox, QDoubleSpinBox { background: @panel; selection-background-color: @chosen; selection-color: @text; }
    QSpinBox:disabled, QDoubleSpinBox:disabled, QComboBox:disabled, QLineEdit:disabled { color: @disabled; }
    QHeaderView::section { background: @panel; color: @quiet; border: none; padding: 4px; }
    QMenuBar, QMenu { background: @panel; } QMenu::item:selected, QMenuBar::item:selected { background: @chosen; }
    QMenu::item:disabled { color: @disabled; }
    QCheckBox::indicator, QRadioButton::indicator { width: 15px; height: 15px; border: 2px solid @quiet;
                                                    background: @ground; }
    QRadioButton::indicator { border-radius: 9px; }
    QCheckBox::indicator { border-radius: 3px; }
    QCheckBox::indicator:checked, QRadioButton::indicator:checked { background: @blue; border-color: @text; }
    QCheckBox::indicator:disabled, QRadioButton::indicator:disabled { border-color: @line; }
    QProgressBar { background: @panel; border: 1px solid @line; border-radius: 4px; text-align: center; }
    QProgressBar::chunk { background: @chosen; }
    QSplitter::handle { background: @raised; }
    QSlider::groove:horizontal { background: @line; height: 4px; }
    QSlider::handle:horizontal { background: @text; width: 14px; margin: -6px 0; border-radius: 7px; }
  )";

}  // namespace

const Colours& colours_of(Theme theme) { return theme == Theme::dark ? dark : light; }

const Colours& colours() { return colours_of(current().theme); }

Appearance applied() { return current(); }

int scaled(int px) { return px * current().text_px / usual_text_px; }

void apply(const Appearance& appearance) {
  current() = appearance;
  current().text_px = std::clamp(appearance.text_px, smallest_text_px, largest_text_px);
  const Colours& in = colours();
  QPalette palette;  // of what no rule styles: arrows of the number fields, links
  for (const auto& [role, colour] : {std::pair(QPalette::Window, in.ground),
                                     {QPalette::WindowText, in.text},
                                     {QPalette::Base, in.panel},
                                     {QPalette::Text, in.text},
                                     {QPalette::Button, in.raised},
                                     {QPalette::ButtonText, in.text},
                                     {QPalette::PlaceholderText, in.quiet},
                                     {QPalette::Link, in.blue},
                                     {QPalette::LinkVisited, in.blue}})
    palette.setColor(role, colour);
  QApplication::setPalette(palette);
  qApp->setStyleSheet(sheet(current()));
}

QString sheet(const Appearance& appearance) {
  const Colours& in = colours_of(appearance.theme);
  QString text = QString::fromLatin1(rules);
  text.replace("@textpx", QString("%1px").arg(appearance.text_px));
  text.replace("@stoppx", QString("%1px").arg(appearance.text_px * 22 / usual_text_px));
  for (const auto& [name, colour] : {std::pair("@ground", in.ground),
                                     {"@panel", in.panel},
                                     {"@raised", in.raised},
                                     {"@pressed", in.pressed},
                                     {"@chosen", in.chosen},
                                     {"@line", in.line},
                                     {"@disabled", in.disabled},
                                     {"@text", in.text},
                                     {"@quiet", in.quiet},
                                     {"@blue", in.blue},
                                     {"@amber", in.amber},
                                     {"@red", in.red},
                                     {"@selected", in.selected}})
    text.replace(name, colour.name());
  return text;
}

}  // namespace helicarm::gui::style
