// SPDX-License-Identifier: Apache-2.0
#include <QAction>
#include <QDockWidget>

#include "gui/window/tour.h"
#include "gui/window/window_test.h"

namespace helicarm::gui {
namespace {

TEST_F(Window, TheTourWalksThroughASimulatedCase) {
  auto* tour = find<Tour>("tour");
  auto* dock = find<QDockWidget>("tourDock");
  EXPECT_FALSE(dock->isVisible());
  click("startTour");
  ASSERT_TRUE(wait("the tour runs", [&] { return tour->is_running() && state().measured && !state().busy; }));
  EXPECT_TRUE(dock->isVisible());
  EXPECT_EQ(state().source, Source::files);
  std::set<QString> titles;
  for (std::size_t step = 0; tour->is_running(); ++step) {
    SCOPED_TRACE(step);
    ASSERT_EQ(tour->step(), step);
    EXPECT_TRUE(tour->outline().isVisible());
    EXPECT_TRUE(window_->rect().contains(tour->outline().geometry()));
    titles.insert(find<QLabel>("tourTitle")->text());
    EXPECT_EQ(find("tourBack")->isEnabled(), step > 0);
    screenshot(fmt::format("tour-{}", step).c_str());
    QTest::mouseClick(find("tourNext"), Qt::LeftButton);
  }
  EXPECT_EQ(titles.size(), 7u);
  EXPECT_FALSE(dock->isVisible());
  EXPECT_FALSE(tour->outline().isVisible());
}

}  // namespace
}  // namespace helicarm::gui
