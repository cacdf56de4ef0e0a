// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QColor>
#include <QString>

/// Dark, legible from 2 m.
namespace helicarm::gui::style {

inline const QColor ground{20, 24, 29}, panel{30, 36, 43}, raised{42, 50, 60}, line{70, 80, 92},
    text{232, 236, 241}, quiet{150, 161, 173}, blue{86, 180, 233}, green{64, 200, 130}, amber{255, 196, 0},
    red{255, 92, 92};

QString sheet();

}  // namespace helicarm::gui::style
