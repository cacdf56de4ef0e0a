// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/pdf_report.h"

#include <QBuffer>
#include <QCoreApplication>
#include <algorithm>

#include "gui/replay/pdf_layout.h"
#include "gui/replay/print_svg.h"
#include "helicarm/core/files.h"
#include "helicarm/report/figures.h"

namespace helicarm::gui {
namespace {

struct Words {
  Q_DECLARE_TR_FUNCTIONS(PdfReport)
};

QString text_of(const std::string& text) { return QString::fromStdString(text); }

QString fixed(std::optional<double> value, int digits = 3) {
  return value ? QString::number(*value, 'f', digits) : QString("–");
}

QString coordinates(const std::optional<Eigen::Vector3d>& p, int digits = 2) {
  return p ? QString("%1, %2, %3").arg(fixed(p->x(), digits), fixed(p->y(), digits), fixed(p->z(), digits))
           : QString("–");
}

QString message_of(const Failure& failure) {
  const std::string_view reason = code(failure.reason);
  return QString("%1%2 (%3)")
      .arg(failure.view.empty() ? QString() : text_of(failure.view) + ": ", text_of(failure.message),
           QString::fromUtf8(reason.data(), qsizetype(reason.size())));
}

void draw_summary(const pipeline::Result& result, PdfLayout& layout) {
  layout.title(Words::tr("helicarm report"));
  layout.paragraph(Words::tr("Research instrument, not a medical device."), PdfLayout::Tone::bad);
  if (result.failure)
    layout.paragraph(Words::tr("Refused: %1").arg(message_of(*result.failure)), PdfLayout::Tone::bad);
  else
    layout.paragraph(Words::tr("Measured."), PdfLayout::Tone::good);
  std::vector<LayoutCard> cards;
  const localization::Accuracy& accuracy = result.accuracy;
  if (accuracy.fle_px.n)
    cards.push_back({fixed(accuracy.fle_px.rms), "px", Words::tr("fiducial localization error, rms")});
  if (accuracy.fre_mm.n)
    cards.push_back({fixed(accuracy.fre_mm.mean), "mm", Words::tr("fiducial registration error, mean")});
  if (accuracy.tre_mm.n)
    cards.push_back({fixed(accuracy.tre_mm.mean), "mm", Words::tr("target registration error, mean")});
  double largest = 0;
  for (const pipeline::PointResult& point : result.points)
    if (point.place)
      largest = std::max(largest, localization::length_at_95(point.place->covariance_in_calibrator));
  if (largest > 0)
    cards.push_back({fixed(largest), "mm", Words::tr("largest predicted error of a point at 95 %")});
  layout.cards(cards);
  if (!result.warnings.empty()) layout.heading(Words::tr("Warnings"));
  for (const Warning& warning : result.warnings) layout.paragraph("• " + message_of(warning));
  if (!result.notes.empty()) layout.heading(Words::tr("Notes: limitations of these data"));
  for (const Warning& note : result.notes) layout.paragraph("• " + message_of(note));
}

void draw_views(const pipeline::Result& result, PdfLayout& layout) {
  std::vector<LayoutFigure> figures;
  for (std::size_t i = 0; i < result.views.size(); ++i) {
    const pipeline::ViewResult& view = result.views[i];
    const std::string figure = report::view_figure(result, i);
    if (figure.empty()) continue;
    QString caption = text_of(view.name);
    if (view.calibrated)
      caption += Words::tr(": reprojection error %1 px rms").arg(fixed(view.calibrated->reprojection_rms_px));
    if (view.found && view.found->mirrored) caption += Words::tr(", stored mirrored");
    figures.push_back({print_svg(figure), caption});
  }
  if (figures.empty()) return;
  layout.heading(Words::tr("Rectified X-ray images"));
  layout.figures(figures);
  layout.paragraph(
      Words::tr("Green: used fiducials, with their residuals as orange arrows. Red crosses: outliers. Blue: "
                "plate. Violet: points. Yellow: planned tunnels. Red lines: tool."),
      PdfLayout::Tone::soft);
}

void draw_points(const pipeline::Result& result, PdfLayout& layout) {
  std::vector<QStringList> rows;
  QStringList missing;
  for (const pipeline::PointResult& point : result.points) {
    if (!point.place) {
      missing << QString("%1: %2").arg(text_of(point.name),
                                       point.reason ? message_of(*point.reason) : Words::tr("not located"));
      continue;
    }
    const Eigen::Vector3d& at = point.place->in_calibrator;
    const Eigen::Matrix3d& covariance = point.place->covariance_in_calibrator;
    const Eigen::Vector3d sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
    rows.push_back({text_of(point.name),
                    point.source == localization::PointSource::pick ? Words::tr("pick") : Words::tr("target"),
                    fixed(at.x(), 2), fixed(at.y(), 2), fixed(at.z(), 2), fixed(sigma.x()), fixed(sigma.y()),
                    fixed(sigma.z()), fixed(localization::length_at_95(covariance)),
                    fixed(point.ray_gap_mm)});
  }
  if (rows.empty() && missing.empty()) return;
  layout.heading(Words::tr("Points in the calibrator frame, mm"));
  if (!rows.empty())
    layout.table({Words::tr("Point"), Words::tr("Kind"), "#x", "#y", "#z", "#σ x", "#σ y", "#σ z",
                  "#" + Words::tr("within (95 %)"), "#" + Words::tr("ray gap")},
                 rows);
  for (const QString& line : missing) layout.paragraph(line, PdfLayout::Tone::bad);
}

void draw_accuracy(const localization::Accuracy& accuracy, PdfLayout& layout) {
  std::vector<QStringList> rows;
  for (const auto& [what, s] : {std::pair{Words::tr("FRE of the fiducials (Eq. 11)"), accuracy.fre_mm},
                                {Words::tr("TRE of the check targets (Eq. 12)"), accuracy.tre_mm}})
    if (s.n > 0)
      rows.push_back({what, fixed(s.mean), fixed(s.rms), fixed(s.max), fixed(s.min), QString::number(s.n)});
  if (rows.empty()) return;
  layout.heading(Words::tr("Accuracy"));
  layout.table({Words::tr("Error, mm"), "#" + Words::tr("mean"), "#rms", "#" + Words::tr("max"),
                "#" + Words::tr("min"), "#n"},
               rows);
  rows.clear();
  for (const localization::TargetError& target : accuracy.targets)
    rows.push_back({text_of(target.name), fixed(target.error_mm), fixed(target.predicted_mm),
                    fixed(target.predicted_95_mm)});
  if (!rows.empty())
    layout.table({Words::tr("Check target"), "#" + Words::tr("error, mm"),
                  "#" + Words::tr("predicted rms, mm"), "#" + Words::tr("predicted at 95 %, mm")},
                 rows);
}

void draw_guidance(const pipeline::Result& result, PdfLayout& layout) {
  std::vector<QStringList> rows;
  for (const guidance::Tunnel& tunnel : result.tunnels)
    rows.push_back({text_of(tunnel.name), coordinates(tunnel.start_in_tool), coordinates(tunnel.end_in_tool),
                    coordinates(tunnel.axis_in_tool, 4), fixed(tunnel.axis_sigma_deg()),
                    fixed(tunnel.length_mm, 2)});
  if (!rows.empty()) {
    layout.heading(Words::tr("Tunnels"));
    layout.table({Words::tr("Tunnel"), Words::tr("start in tool, mm"), Words::tr("end in tool, mm"),
                  Words::tr("axis in tool"), "#" + Words::tr("axis ±, °"), "#" + Words::tr("length, mm")},
                 rows);
  }
  rows.clear();
  for (const verification::Verification& line : result.verifications)
    for (const auto& [end, error] :
         {std::pair{Words::tr("start"), &line.start}, {Words::tr("end"), &line.end}})
      if (*error)
        rows.push_back({text_of(line.name), end, fixed((*error)->combined_px, 2),
                        fixed((*error)->combined_mm, 2), fixed((*error)->distance_mm, 2)});
  if (rows.empty()) return;
  layout.heading(Words::tr("Verification"));
  layout.table({Words::tr("Tool line"), Words::tr("end of tunnel"), "#" + Words::tr("Eq. 17, px"),
                "#" + Words::tr("Eq. 17, mm"), "#" + Words::tr("in space, mm")},
               rows);
}

void draw_rectification(const pipeline::Result& result, PdfLayout& layout) {
  std::vector<QStringList> rows;
  std::vector<LayoutFigure> figures;
  for (const pipeline::ViewResult& view : result.views) {
    if (!view.rectification || view.rectification->map.is_identity()) continue;
    const rectification::Rectification& of = *view.rectification;
    const QString found = QString::number(of.dots_found);
    rows.push_back({text_of(view.name),
                    of.dots_expected ? Words::tr("%1 of %2").arg(found).arg(*of.dots_expected) : found,
                    fixed(of.map.residual_rms_px), fixed(of.map.held_out_rms_px), fixed(of.raw_mean_px, 2),
                    fixed(of.raw_max_px, 2)});
    if (const std::string figure = report::distortion_figure(view); !figure.empty())
      figures.push_back(
          {print_svg(figure, true), Words::tr("Distortion in %1: displacement from rectified to raw position")
                                        .arg(text_of(view.name))});
  }
  if (rows.empty()) return;
  layout.heading(Words::tr("Rectification"));
  layout.table({Words::tr("View"), Words::tr("plate dots"), "#" + Words::tr("residual, px"),
                "#" + Words::tr("cross-validated, px"), "#" + Words::tr("distortion, px"),
                "#" + Words::tr("largest, px")},
               rows);
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
    writer.setTitle(Words::tr("helicarm report"));
    writer.setCreator("helicarm " HELICARM_VERSION);
    const QString method = result.options.method == rectification::Method::paper ? "paper" : "best";
    PdfLayout layout(writer, Words::tr("helicarm %1, method %2 · research instrument, not a medical device")
                                 .arg(HELICARM_VERSION, method));
    draw_summary(result, layout);
    draw_views(result, layout);
    draw_points(result, layout);
    draw_accuracy(result.accuracy, layout);
    draw_guidance(result, layout);
    draw_rectification(result, layout);
  }
  return write_file(path, {bytes.constData(), std::size_t(bytes.size())});
}

}  // namespace helicarm::gui
