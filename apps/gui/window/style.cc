// SPDX-License-Identifier: Apache-2.0
#include "gui/window/style.h"

namespace helicarm::gui::style {

QString sheet() {
  return QStringLiteral(R"(
    * { font-size: 14px; color: #e8ecf1; }
    QMainWindow, QDialog, QWidget { background: #14181d; }
    QToolTip { background: #2a323c; border: 1px solid #46505c; padding: 4px; }
    QGroupBox { border: 1px solid #46505c; border-radius: 6px; margin-top: 10px; padding: 8px 6px 6px 6px; }
    QGroupBox::title { subcontrol-origin: margin; left: 10px; color: #96a1ad; }
    QPushButton { background: #2a323c; border: 1px solid #46505c; border-radius: 5px; padding: 7px 12px; }
    QPushButton:hover { background: #35404c; }
    QPushButton:focus { border: 2px solid #e8ecf1; }
    QPushButton:disabled { color: #66707b; background: #1e242b; }
    QPushButton[class="hold"] { border: 1px solid #ffc400; }
    QPushButton[class="hold"]:disabled { border: 1px solid #46505c; }
    QPushButton[class="stop"] { background: #c81e1e; border: 2px solid #ff8080; color: white; font-size: 22px;
                                font-weight: bold; padding: 10px 22px; }
    QPushButton[class="stop"]:pressed { background: #ff4040; }
    QTableWidget, QListWidget, QPlainTextEdit, QLineEdit, QSpinBox, QDoubleSpinBox, QComboBox {
      background: #1e242b; border: 1px solid #46505c; border-radius: 4px; padding: 3px;
      selection-background-color: #35506b; }
    QHeaderView::section { background: #1e242b; color: #96a1ad; border: none; padding: 4px; }
    QMenuBar, QMenu { background: #1e242b; } QMenu::item:selected, QMenuBar::item:selected { background: #35506b; }
    QCheckBox::indicator, QRadioButton::indicator { width: 15px; height: 15px; border: 2px solid #96a1ad;
                                                    background: #14181d; }
    QRadioButton::indicator { border-radius: 9px; }
    QCheckBox::indicator { border-radius: 3px; }
    QCheckBox::indicator:checked, QRadioButton::indicator:checked { background: #6cb6ff; border-color: #e8ecf1; }
    QCheckBox::indicator:disabled, QRadioButton::indicator:disabled { border-color: #46505c; }
    QProgressBar { background: #1e242b; border: 1px solid #46505c; border-radius: 4px; text-align: center; }
    QProgressBar::chunk { background: #35506b; }
    QSplitter::handle { background: #2a323c; }
    QSlider::groove:horizontal { background: #46505c; height: 4px; }
    QSlider::handle:horizontal { background: #e8ecf1; width: 14px; margin: -6px 0; border-radius: 7px; }
  )");
}

}  // namespace helicarm::gui::style
