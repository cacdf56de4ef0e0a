// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/pdf_report.h"

#include <QBuffer>
#include <QCoreApplication>

#include "gui/replay/pdf_layout.h"
#include "gui/replay/print_svg.h"
#include "helicarm/core/files.h"
#include "helicarm/report/figures.h"
#include "helicarm/report/tables.h"

namespace helicarm::gui {
namespace {

struct ReportWords {
  Q_DECLARE_TR_FUNCTIONS(PdfReport)
};

QString text_of(const std::string& text) { return QString::fromStdString(text); }

void draw_summary(const pipeline::Result& result, PdfLayout& layout) {
  layout.title(ReportWords::tr("helicarm report"));
  layout.paragraph(ReportWords::tr("Research instrument, not a medical device."), PdfLayout::Tone::bad);
  if (result.failure)
    layout.paragraph(ReportWords::tr("Refused: %1").arg(text_of(report::message_of(*result.failure))),
                     PdfLayout::Tone::bad);
  else
    layout.paragraph(ReportWords::tr("Measured."), PdfLayout::Tone::good);
  std::vector<LayoutCard> cards;
  for (const report::KeyFigure& figure : report::key_figures(result))
    cards.push_back({text_of(figure.value), text_of(figure.unit), text_of(figure.what)});
  layout.cards(cards);
  if (!result.warnings.empty()) layout.heading(ReportWords::tr("Warnings"));
  for (const Warning& warning : result.warnings)
    layout.paragraph("• " + text_of(report::message_of(warning)));
  if (!result.notes.empty()) layout.heading(ReportWords::tr("Notes: limitations of these data"));
  for (const Warning& note : result.notes) layout.paragraph("• " + text_of(report::message_of(note)));
}

void draw_views(const pipeline::Result& result, PdfLayout& layout) {
  std::vector<LayoutFigure> figures;
  for (std::size_t i = 0; i < result.views.size(); ++i) {
    const pipeline::ViewResult& view = result.views[i];
    const std::string figure = report::view_figure(result, i);
    if (figure.empty()) continue;
    QString caption = text_of(view.name);
    if (view.calibrated)
      caption += ReportWords::tr(": reprojection error %1 px rms")
                     .arg(view.calibrated->reprojection_rms_px, 0, 'f', 3);
    if (view.found && view.found->mirrored) caption += ReportWords::tr(", stored mirrored");
    figures.push_back({print_svg(figure), caption});
  }
  if (figures.empty()) return;
  layout.heading(ReportWords::tr("Rectified X-ray images"));
  layout.figures(figures);
  layout.paragraph(
      ReportWords::tr(
          "Green: used fiducials, with their residuals as orange arrows. Red crosses: outliers. Blue: "
          "plate. Violet: points. Yellow: planned tunnels. Red lines: tool."),
      PdfLayout::Tone::soft);
}

void draw_tables(const pipeline::Result& result, PdfLayout& layout) {
  for (const report::Table& table : report::tables_of(result)) {
    layout.heading(text_of(table.heading));
    layout.table(table);
  }
}

void draw_distortion(const pipeline::Result& result, PdfLayout& layout) {
  std::vector<LayoutFigure> figures;
  for (const pipeline::ViewResult& view : result.views)
    if (const std::string figure = report::distortion_figure(view); !figure.empty())
      figures.push_back(
          {print_svg(figure, true),
           ReportWords::tr("%1: displacement from rectified to raw position").arg(text_of(view.name))});
  if (figures.empty()) return;
  layout.heading(ReportWords::tr("Distortion"));
  layout.figures(figures);
}

}  // namespace

Expected<void> write_pdf_report(const pipeline::Result& result, const std::filesystem::path& path) {
  QByteArray bytes;
  {
    QBuffer buffer(&bytes);
    buffer.open(QIODevice::WriteOnly);
    QPdfWriter writer(&buffer);
    writer.setPageSize(QPageSize(QPageSize::A4));
    writer.setPageMargins(QMarginsF(18, 16, 18, 12), QPageLayout::Millimeter);
    writer.setResolution(300);
    writer.setTitle(ReportWords::tr("helicarm report"));
    writer.setCreator("helicarm " HELICARM_VERSION);
    const std::string method(word(result.options.method));
    PdfLayout layout(writer,
                     ReportWords::tr("helicarm %1, method %2 · research instrument, not a medical device")
                         .arg(HELICARM_VERSION, method.c_str()));
    draw_summary(result, layout);
    draw_views(result, layout);
    draw_tables(result, layout);
    draw_distortion(result, layout);
  }
  return write_file(path, {bytes.constData(), std::size_t(bytes.size())});
}

}  // namespace helicarm::gui
