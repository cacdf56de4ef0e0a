// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/print_svg.h"

#include <QRegularExpression>
#include <QString>
#include <QStringList>
#include <map>

namespace helicarm::gui {
namespace {

struct Look {
  const char* kind;
  const char* attributes;
};

/// Half a page is smaller than a screen: letters and lines are enlarged by this factor.
constexpr double letters = 1.9, lines = 1.5;

constexpr Look looks[] = {{"ball", R"(stroke="#4ade80")"},
                          {"ball lost", R"(stroke="#f87171" stroke-dasharray="4 3")"},
                          {"plate", R"(stroke="#93c5fd" stroke-opacity="0.6")"},
                          {"residual", R"(stroke="#fb923c")"},
                          {"false", R"(stroke="#f87171")"},
                          {"point", R"(stroke="#f0abfc")"},
                          {"planned", R"(stroke="#facc15")"},
                          {"tool", R"(stroke="#ef4444")"},
                          {"field", R"(stroke="#0b6e75")"},
                          {"frame", R"(stroke="#dcd8cf")"}};

/// Multiplies all numbers of an attribute by a factor.
void enlarge(QString& svg, const QString& attribute, double factor) {
  const QRegularExpression pattern(attribute + "=\"([0-9.]+)\"");
  qsizetype from = 0;
  for (auto found = pattern.match(svg); found.hasMatch(); found = pattern.match(svg, from)) {
    const QString number = QString::number(found.captured(1).toDouble() * factor);
    from = found.capturedStart(1) + number.size();
    svg.replace(found.capturedStart(1), found.capturedLength(1), number);
  }
}

}  // namespace

QByteArray print_svg(const std::string& figure, bool on_page) {
  QString svg = QString::fromStdString(figure);
  svg.replace(
      QRegularExpression("^<svg "),
      R"(<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" fill="none" )"
      R"(font-family="DejaVu Sans, sans-serif" )");
  enlarge(svg, "font-size", letters);
  enlarge(svg, "stroke-width", lines);
  svg.replace(" href=\"data:", " xlink:href=\"data:");
  for (const auto& [kind, attributes] : looks) svg.replace(QString("class=\"%1\"").arg(kind), attributes);
  svg.replace("class=\"bar\"",
              on_page ? R"(stroke="#1d2326" stroke-width="3")" : R"(stroke="#fff" stroke-width="3")");
  static const QRegularExpression text(R"(<text class="[^"]*" ([^>]*)>([^<]*)</text>)");
  // QtSvg has no paint-order for outlined letters: a shadow keeps white ones legible on white bone.
  svg.replace(text, on_page
                        ? R"x(<text fill="#1d2326" stroke="none" \1>\2</text>)x"
                        : R"x(<text fill="#000" stroke="none" transform="translate(1.7 1.7)" \1>\2</text>)x"
                          R"x(<text fill="#000" stroke="none" transform="translate(-1 -1)" \1>\2</text>)x"
                          R"x(<text fill="#fff" stroke="none" \1>\2</text>)x");
  return svg.toUtf8();
}

QByteArray chart_document(const std::string& chart) {
  QString svg = QString::fromStdString(chart);
  static const QRegularExpression rule(R"(\.(\w+)\{([^}]*)\})"), classes(R"x(class="([^"]*)")x");
  static const QRegularExpression clip(R"(<clipPath[^>]*>.*?</clipPath>)");
  svg.remove(clip);
  std::map<QString, QString> rules;
  const QString sheet = svg.section("<style>", 1).section("</style>", 0, 0);
  for (auto each = rule.globalMatch(sheet); each.hasNext();) {
    const auto found = each.next();
    rules[found.captured(1)] = found.captured(2);
  }
  qsizetype from = 0;
  for (auto found = classes.match(svg); found.hasMatch(); found = classes.match(svg, from)) {
    QStringList parts;
    for (const QString& name : found.captured(1).split(' '))
      if (rules.contains(name)) parts << rules[name];
    const QString style = "style=\"" + parts.join(';') + '"';
    svg.replace(found.capturedStart(), found.capturedLength(), style);
    from = found.capturedStart() + style.size();
  }
  return svg.toUtf8();
}

}  // namespace helicarm::gui
