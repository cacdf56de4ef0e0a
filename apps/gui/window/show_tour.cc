// SPDX-License-Identifier: Apache-2.0
// The tour of the window on a simulated case.
#include <QApplication>
#include <QDockWidget>
#include <QThreadPool>

#include "gui/window/main_window.h"
#include "gui/window/tour.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

constexpr int tour_image_px = 512;

/// Anew each time: the picks of an earlier tour are gone.
Expected<void> write_tour_case(const fs::path& folder) {
  return guarded([&] {
    fs::remove_all(folder);
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    options.size = tour_image_px;
    value_or_throw(simulation::write_case(folder, value_or_throw(simulation::simulate_case(options))));
  });
}

}  // namespace

void MainWindow::build_tour() {
  tour_ = new Tour(this);
  QDockWidget* dock = add_panel(tr("Tour"), "tourDock", tour_);
  dock->setFeatures(QDockWidget::NoDockWidgetFeatures);
  connect(tour_, &Tour::ended, dock, &QWidget::hide);
  connect(tour_, &Tour::phase_wanted, this, [this](Phase phase) {
    moved_on_ = true;
    show_phase(phase);
  });
}

void MainWindow::ask_tour() {
  leave_then([this] { start_tour(); });
}

void MainWindow::start_tour() {
  const fs::path folder = sessions_ / "tour" / "simulated-knee";
  tell(tr("The simulated case of the tour is being made."));
  QThreadPool::globalInstance()->start([self = QPointer<MainWindow>(this), folder] {
    const auto written = write_tour_case(folder);
    QMetaObject::invokeMethod(
        qApp,
        [self, folder, written] {
          if (!self) return;
          if (!written) return self->say(written.error());
          self->tell(tr("The case of the tour is simulated: no patient, no C-arm."));
          self->controller_.open_case(folder);
          self->findChild<QDockWidget*>("tourDock")->show();
          self->tour_->begin(self->tour_steps());
        },
        Qt::QueuedConnection);
  });
}

std::vector<TourStep> MainWindow::tour_steps() {
  return {
      {Phase::acquire, strip_, tr("A case in steps"),
       tr("This case is simulated: a knee in two X-ray images, with the calibrator around it and planned "
          "tunnels. Each card is a step: green is done, amber needs a look or is out of date, red is "
          "refused, "
          "with its reason. A click on a card opens its page at the lower right.")},
      {Phase::rectify, panels_, tr("Distortion"),
       tr("The dots of the plate in the image give the intensifier's distortion. The key L on an image shows "
          "it raw, rectified and without the plate's dots.")},
      {Phase::calibrate, panels_, tr("Cameras"),
       tr("The calibrator's fiducials are labelled, and each image has its camera. The arrows are residuals, "
          "enlarged by the factor at the lower left; the table has every number.")},
      {Phase::plan, panels_, tr("Points"),
       tr("Drag FS in an image: what depends on it is out of date at once, and measured again. Ctrl+Z takes "
          "it back. The table has the 95 % error of each point.")},
      {Phase::plan, scene_, tr("The scene"),
       tr("Drag to turn, wheel to zoom; keys 1 and 2 look along the X-rays, 4 goes near. Ellipsoids are the "
          "95 % regions. View, Objects of the scene hides each part or makes it transparent.")},
      {Phase::verify, pages_, tr("Results"),
       tr("The tool's line is compared with the planned tunnel. Export writes the report, the numbers and "
          "files for other programs, and says before what it would lack.")},
      {Phase::acquire, panels_, tr("Your own images"),
       tr("Drag X-ray images into the window: a dialog makes a case of them. A case folder dragged in is "
          "opened; File, Recent has the earlier ones. Help, Tour starts this again.")},
  };
}

}  // namespace helicarm::gui
