// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/table.h"

#include <gtest/gtest.h>

namespace helicarm::report {
namespace {

Table of_balls() {
  return {"Balls",
          {{"Ball", "Label <b>"}, {"u, px", "Column", true}, {"Remark", ""}},
          {{{"P1"}, {"1.5", false, 0.5}, {}}, {{"P<2>"}, {"22.5", true}, {""}}}};
}

TEST(Html, NumbersAreMarkedAndDefinitionsAreToolTips) {
  const std::string html = html_of(of_balls());
  EXPECT_NE(html.find("<th title=\"Label &lt;b&gt;\">Ball</th><th class=\"n\" title=\"Column\">u, px</th>"),
            std::string::npos)
      << html;
  EXPECT_NE(html.find("<td>P1</td><td class=\"n\">"), std::string::npos) << html;
}

TEST(Html, CellsAreEscapedAndBadOnesMarked) {
  const std::string html = html_of(of_balls());
  EXPECT_NE(html.find("<td>P&lt;2&gt;</td><td class=\"n\"><span class=\"bad\">22.5</span></td>"),
            std::string::npos)
      << html;
}

TEST(Html, BarHasItsShareOfTheLongest) {
  EXPECT_NE(html_of(of_balls()).find("width:4.00rem\"></span> 1.5</td>"), std::string::npos);
}

TEST(Text, ColumnsAreAlignedByCharacters) {
  Table table = of_balls();
  table.columns[0].title = "σ";
  EXPECT_EQ(text_of(table),
            "  σ      u, px  Remark\n"
            "  P1       1.5  –\n"
            "  P<2>  22.5 !\n");
}

TEST(EmptyColumns, AreOmitted) {
  const Table table = without_empty_columns(of_balls());
  ASSERT_EQ(table.columns.size(), 2u);
  EXPECT_EQ(table.columns[1].title, "u, px");
  for (const auto& row : table.rows) EXPECT_EQ(row.size(), 2u);
}

TEST(Beside, RowsOfBothAreJoined) {
  const Table table = beside(of_balls(), of_balls());
  EXPECT_EQ(table.columns.size(), 6u);
  EXPECT_EQ(table.rows[1][3].text, "P<2>");
}

}  // namespace
}  // namespace helicarm::report
