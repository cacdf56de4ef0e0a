// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/pdf_document.h"

#include <algorithm>
#include <limits>

#include <gmock/gmock.h>

namespace helicarm::report {
namespace {

using testing::HasSubstr;
using testing::Not;

std::size_t count_of(const std::string& text, const std::string& words) {
  std::size_t count = 0;
  for (std::size_t at = text.find(words); at != std::string::npos; at = text.find(words, at + 1)) ++count;
  return count;
}

Table rows(int count) {
  Table table{"Acquisitions", {{"view", "", false}, {"mm", "", true}}};
  for (int i = 0; i < count; ++i) table.rows.push_back({{"A(" + std::to_string(i)}, {"1.5 ±0.2", i == 0}});
  return table;
}

TEST(PdfDocument, EveryObjectIsWhereTheTableSays) {
  PdfDocument pdf("C-arm", "footer");
  pdf.table(rows(3));
  const std::string file = pdf.bytes();
  const std::size_t start = std::stoul(file.substr(file.find("startxref\n") + 10));
  ASSERT_EQ(file.substr(start, 7), "xref\n0 ");
  const std::size_t count = std::stoul(file.substr(start + 7));
  std::size_t line = file.find('\n', start + 7) + 1 + 20;  // the first entry is of no object
  for (std::size_t i = 1; i < count; ++i, line += 20) {
    const std::string head = std::to_string(i) + " 0 obj\n";
    EXPECT_EQ(file.substr(std::stoul(file.substr(line, 10)), head.size()), head);
  }
}

TEST(PdfDocument, TextIsEscapedAndInTheFontsEncoding) {
  PdfDocument pdf("C-arm", "");
  pdf.table(rows(1));
  pdf.paragraph("10° – 2 λ \\");
  EXPECT_THAT(pdf.bytes(), HasSubstr("(A\\(0)"));
  EXPECT_THAT(pdf.bytes(), HasSubstr("(1.5 \xB1"
                                     "0.2 !)"));
  EXPECT_THAT(pdf.bytes(), HasSubstr("(10\xB0 \x96 2 ? \\\\)"));
}

TEST(PdfDocument, LongTablesRepeatTheirHeadingsOnEachPage) {
  PdfDocument pdf("C-arm", "");
  pdf.table(rows(200));
  const std::size_t pages = count_of(pdf.bytes(), "/Type /Page ");
  EXPECT_GT(pages, 2U);
  EXPECT_EQ(count_of(pdf.bytes(), "(view)"), pages);
  for (const int i : {0, 57, 199}) EXPECT_EQ(count_of(pdf.bytes(), "(A\\(" + std::to_string(i) + ")"), 1U);
}

TEST(PdfDocument, ChartsLeaveOutWhatIsNotFinite) {
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  Chart chart{"sag", "angle", "mm"};
  chart.series = {{"predicted", {{0, 1}, {1, none}, {2, 3}, {3, 4}}}, {"seen", {{1, 2}}, true}};
  PdfDocument pdf("C-arm", "");
  pdf.chart(chart);
  pdf.chart({"empty", "angle", "mm"});
  EXPECT_THAT(pdf.bytes(), HasSubstr(R"(predicted \(line\); seen \(dots\))"));
  EXPECT_THAT(pdf.bytes(), Not(HasSubstr("nan")));
  EXPECT_THAT(pdf.bytes(), Not(HasSubstr("inf")));
}

TEST(PdfDocument, LongParagraphsAreBroken) {
  std::string words;
  for (int i = 0; i < 100; ++i) words += "repeatability ";
  PdfDocument pdf("C-arm", "");
  pdf.paragraph(words);
  EXPECT_GT(count_of(pdf.bytes(), "(repeatability"), 8U);
}

}  // namespace
}  // namespace helicarm::report
