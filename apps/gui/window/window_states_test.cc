// SPDX-License-Identifier: Apache-2.0
// The table of states of docs/desktop.md: after each change of an input every page shows what the present
// inputs give, and nothing else.
#include <QDoubleSpinBox>
#include <QRegularExpression>
#include <QScrollArea>

#include "gui/controller/case_with_model_test.h"
#include "gui/controller/model_landmarks.h"
#include "gui/controller/stale.h"
#include "gui/window/plan_tables.h"
#include "gui/window/window_test.h"
#include "gui/xray/text.h"
#include "helicarm/case_registration/measure_case.h"
#include "helicarm/case_registration/registration_tables.h"
#include "helicarm/report/tables.h"

namespace helicarm::gui {
namespace {

/// A row of the table: by page in the order of the steps, `-` as measured, `S` out of date, `.` without
/// figures.
struct InputChange {
  const char* name;
  const char* expected;  ///< Acquire, Rectify, Calibrate, Register, Plan, Navigate, Verify
  bool has_model;
};

void PrintTo(const InputChange& change, std::ostream* out) { *out << change.name; }

constexpr std::array in_order{Phase::acquire, Phase::rectify,  Phase::calibrate, Phase::registration,
                              Phase::plan,    Phase::navigate, Phase::verify};

class WindowStates : public Window, public testing::WithParamInterface<InputChange> {
 protected:
  void SetUp() override {
    if (GetParam().has_model) {
      const auto truth = write_case_with_model(folder_ / "case");
      ASSERT_NO_FATAL_FAILURE(use_landmarks(truth));
    } else {
      write_tunnels(folder_ / "case", "AP:2,1");
    }
    window_->open_paths({folder_ / "case"});
    ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
    if (!GetParam().has_model) return;
    click("registerModels");
    ASSERT_TRUE(wait("the model is registered", [&] { return state().registration && !state().busy; }));
    ASSERT_FALSE(state().registration->models[0].registration.failure);
  }
  static void write_tunnels(const fs::path& folder, const char* ap) {
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    options.size = 512;
    for (const char* view : {ap, "LAT:88,-2"}) options.views.push_back(*simulation::view_angles(view));
    ASSERT_TRUE(simulation::write_case(folder, simulation::simulate_case(options).value()));
  }
  /// The model starts by four landmarks, which are picked where the measured views see them.
  void use_landmarks(const geometry::RigidTransform& calibrator_from_patient) {
    window_->open_paths({folder_ / "case"});
    ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
    Json json = read_json(folder_ / "case" / "case.json").value();
    std::string landmarks = "name,x_mm,y_mm,z_mm\n";
    int number = 0;
    for (const Eigen::Vector3d& at : {Eigen::Vector3d(0, 0, -30), {0, 0, 30}, {12, 4, -20}, {-14, 14, 24}}) {
      const std::string name = fmt::format("L{}", ++number);
      landmarks += fmt::format("{},{},{},{}\n", name, at.x(), at.y(), at.z());
      for (const pipeline::ViewResult& view : state().result->views) {
        const Eigen::Vector2d uv = view.rectification->map.raw_from_rectified(
            view.calibrated->view.project(calibrator_from_patient * at));
        json["picks"].push_back({{"name", name}, {"view", view.name}, {"uv", {uv.x(), uv.y()}}});
      }
    }
    ASSERT_TRUE(write_file(folder_ / "case" / "landmarks.csv", landmarks));
    json["models"][0]["start"] = {{"landmarks", "landmarks.csv"}};
    ASSERT_TRUE(write_file(folder_ / "case" / "case.json", to_text(json)));
  }
  void change_json(const char* file, const std::function<void(Json&)>& change) {
    Json json = read_json(folder_ / "case" / file).value();
    change(json);
    ASSERT_TRUE(write_file(folder_ / "case" / file, to_text(json)));
    ASSERT_TRUE(wait("the change is noticed", [&] { return !state().changed_file.empty(); }));
  }
  void move_pick() {
    pipeline::Pick pick = *pick_of(state(), "FS", "AP");
    pick.uv_raw.x() += 3;
    pick.snap = pipeline::Snap::none;
    window_->controller().pick(pick);
  }

  /// Makes the change; what it measures itself has not run yet.
  void change() {
    const std::string name = GetParam().name;
    if (name == "PickMoved") return move_pick();
    if (name == "PickTakenOtherwise") return window_->controller().set_snap("FS", pipeline::Snap::none);
    if (name == "PickErased") return window_->controller().erase_picks("FE");
    if (name == "PicksCleared") return window_->controller().clear_picks();
    if (name == "CalibratorChanged")
      return change_json("calibrator.json", [](Json& json) {
        json["balls"][0]["xyz_mm"][0] = json["balls"][0]["xyz_mm"][0].get<double>() + 0.02;
      });
    if (name == "PlateChanged")
      return change_json("plate.json", [](Json& json) { json["diameter_mm"] = 2.45; });
    if (name == "ImageOfAViewChanged") {
      write_tunnels(folder_ / "other", "AP:4,2");
      fs::copy_file(folder_ / "other" / "AP.dcm", folder_ / "case" / "AP.dcm",
                    fs::copy_options::overwrite_existing);
      ASSERT_TRUE(wait("the change is noticed", [&] { return !state().changed_file.empty(); }));
      return;
    }
    if (name == "FrameOfAViewChanged")
      return change_json("case.json", [](Json& json) { json["views"][0]["frame"] = 1; });
    if (name == "SettingsChanged") {
      case_registration::RegisterOptions options;
      options.run.motion_sigma_mm = 0.5;
      options_ = options;
      return window_->controller().set_options(options);
    }
    if (name == "ModelMovedByHand") return find<QDoubleSpinBox>("shiftX")->setValue(4);
    if (name == "ModelFileChanged") {
      std::string bytes = *read_file(folder_ / "case" / "ct.nrrd", 1 << 28);
      for (std::size_t i = bytes.size() - 4000; i < bytes.size(); i += 2) bytes[i] = 0;
      ASSERT_TRUE(write_file(folder_ / "case" / "ct.nrrd", bytes));
      ASSERT_TRUE(wait("the change is noticed", [&] { return !state().changed_file.empty(); }));
      return;
    }
    if (name == "LandmarkMoved") {
      pipeline::Pick pick = *pick_of(state(), "L1", "AP");
      pick.uv_raw.x() += 2;
      return window_->controller().pick(pick);
    }
    if (name == "LandmarkMovedInTheModel") {
      pipeline::PointInModel landmark = state().model_landmarks.at(0).at(0);
      landmark.in_model.x() += 1;
      return window_->controller().place_landmarks(0, {landmark});
    }
    if (name == "AnotherLayerShown") return window_->xrays().set_layer(Layer::raw);
    FAIL() << name;
  }
  void measure_again() {
    if (state().nudged) {
      find<QDoubleSpinBox>("shiftX")->setValue(0);
    } else {
      QTest::keyClick(window_.get(), Qt::Key_F5);
    }
    ASSERT_TRUE(wait("it is measured", [&] {
      return state().measured && !state().busy && stale(state(), Phase::calibrate).isEmpty();
    }));
    if (!GetParam().has_model) return;
    if (state().registration && stale(state(), Phase::registration).isEmpty()) return;
    click("registerModels");
    ASSERT_TRUE(wait("the model is registered", [&] {
      return state().registration && !state().busy && stale(state(), Phase::registration).isEmpty();
    }));
  }

  /// Numbers with decimals in the page's tables: figures, no labels.
  QStringList figures_on(Phase phase) {
    QStringList figures;
    static const QRegularExpression figure("-?\\d+\\.\\d+");
    for (PageTable* table : page(phase)->findChildren<PageTable*>())
      for (int row = 0; row < table->rowCount(); ++row)
        for (int column = 1; column < table->columnCount(); ++column)
          if (const QString words = table->item(row, column)->text(); words.contains(figure))
            figures << QString("%1 %2: %3").arg(table->objectName(), table->item(row, 0)->text(), words);
    return figures;
  }
  QWidget* page(Phase phase) {
    return static_cast<QScrollArea*>(find<QStackedWidget>("pages")->widget(int(phase)))->widget();
  }
  QString sentences_on(Phase phase) {
    QStringList words;
    for (const QLabel* label : page(phase)->findChildren<QLabel*>())
      if (label->isVisibleTo(page(phase))) words << label->text();
    for (const PageTable* table : page(phase)->findChildren<PageTable*>())
      for (int row = 0; row < table->rowCount(); ++row)
        words << table->item(row, table->columnCount() - 1)->text();
    return words.join('\n');
  }
  /// `-`, `S` or `.` of a page; a page that is out of date in part names what is.
  char seen_on(Phase phase) {
    const StepCard step = steps_of(state())[std::size_t(phase)];
    if (!step.is_offered) return '.';
    if (step.out_of_date.isEmpty()) return step.figure.isEmpty() && figures_on(phase).isEmpty() ? '.' : '-';
    return 'S';
  }
  void expect_no_figure_that_is_out_of_date() {
    const bool all = !stale(state(), Phase::calibrate).isEmpty();
    for (const Phase phase : in_order) {
      const StepCard step = card(phase);
      if (step.out_of_date.isEmpty()) continue;
      SCOPED_TRACE(step.name.toStdString());
      EXPECT_TRUE(step.figure.isEmpty()) << step.figure.toStdString();
      EXPECT_NE(step.status, StepStatus::good);
      if (!all) continue;
      EXPECT_TRUE(figures_on(phase).isEmpty()) << figures_on(phase).join('\n').toStdString();
      EXPECT_TRUE(step.status == StepStatus::waiting || sentences_on(phase).contains(step.out_of_date))
          << sentences_on(phase).toStdString();
    }
    const QStringList figures = figures_on(Phase::plan) + figures_on(Phase::verify);
    for (const std::string& point : old_points())
      EXPECT_TRUE(figures.filter(" " + text(point) + ":").isEmpty()) << figures.join('\n').toStdString();
    if (!state().nudged) return;
    for (const QString& figure : figures_on(Phase::registration) + figures_on(Phase::plan).filter("endTable"))
      EXPECT_FALSE(figure.contains("tunnel_") || figure.contains("modelTable")) << figure.toStdString();
  }
  std::vector<std::string> old_points() {
    std::vector<std::string> old;
    for (const pipeline::PointResult& point : state().result->points)
      if (is_stale(state(), point.name) && point.source == localization::PointSource::pick)
        old.push_back(point.name);
    return old;
  }

  /// Cells that a table of the report has and the window's does not show so.
  static QStringList differences(const PageTable& shown, const report::Table& fresh) {
    QStringList different;
    if (shown.rowCount() != int(fresh.rows.size()))
      different << QString("%1: %2 rows, not %3")
                       .arg(shown.objectName())
                       .arg(shown.rowCount())
                       .arg(fresh.rows.size());
    for (int row = 0; row < shown.rowCount() && different.isEmpty(); ++row)
      for (int column = 0; column < shown.columnCount(); ++column) {
        const QString seen = shown.item(row, column)->text();
        const QString measured = text(fresh.rows[std::size_t(row)][std::size_t(column)].text);
        if (seen != measured)
          different << QString("%1 %2: %3, not %4")
                           .arg(shown.objectName(), shown.item(row, 0)->text(), seen, measured);
      }
    return different;
  }
  /// As `helicarm run` measures the folder, with the present picks and the tunnels of which both ends are
  /// picked.
  void expect_as_measured_afresh() {
    pipeline::Case the_case = pipeline::read_case(folder_ / "case").value();
    the_case.picks = state().picks;
    start_from_landmarks(the_case, state().model_landmarks, {});
    const auto lacks = [&](const std::string& end) {
      return std::ranges::find(the_case.picks, end, &pipeline::Pick::name) == the_case.picks.end();
    };
    for (std::size_t i = the_case.tunnels.size(); i-- > 0;) {
      const pipeline::CaseTunnel tunnel = the_case.tunnels[i];
      if (!lacks(tunnel.start) && !lacks(tunnel.end)) continue;
      the_case.tunnels.erase(the_case.tunnels.begin() + std::ptrdiff_t(i));
      std::erase_if(the_case.tool_lines, [&](const auto& line) { return line.tunnel == tunnel.name; });
    }
    const auto measured = case_registration::measure_case(the_case, options_);
    ASSERT_TRUE(measured) << measured.error().message;
    const pipeline::Result& fresh = measured->result;
    QStringList wrong =
        differences(*find<PageTable>("rectifyTable"), report::rectification_table(fresh.views)) +
        differences(*find<PageTable>("viewTable"), report::calibration_table(fresh.views)) +
        differences(*find<PageTable>("ballTable"), report::fiducials_table(fresh.views)) +
        differences(*find<PageTable>("outcomeTable"),
                    report::verification_table(report::tools_at_ends(fresh.verifications)));
    if (measured->registration) {
      wrong += differences(*find<PageTable>("modelTable"),
                           case_registration::models_table(measured->registration->models));
      wrong += differences(*find<PageTable>("modelPointTable"),
                           case_registration::points_table(measured->registration->models));
    }
    const auto* ends = find<PageTable>("endTable");
    const report::Table places = report::positions_table(fresh.points);
    for (std::size_t i = 0; i < fresh.points.size(); ++i) {
      if (fresh.points[i].source == localization::PointSource::target) continue;
      const auto rows = ends->findItems(text(fresh.points[i].name), Qt::MatchExactly);
      ASSERT_EQ(rows.size(), 1) << fresh.points[i].name;
      for (std::size_t column = 0; column < places.columns.size(); ++column)
        if (ends->item(rows[0]->row(), int(column) + 3)->text() != text(places.rows[i][column].text))
          wrong << text(fresh.points[i].name + ": " + places.rows[i][column].text);
    }
    EXPECT_TRUE(wrong.isEmpty()) << wrong.join('\n').toStdString();
    ApplicationState as_fresh = state();
    as_fresh.result = std::make_shared<const pipeline::Result>(fresh);
    const StepCards cards = steps_of(as_fresh);
    for (const Phase phase : {Phase::rectify, Phase::calibrate, Phase::plan})
      EXPECT_EQ(card(phase).figure.toStdString(), cards[std::size_t(phase)].figure.toStdString());
  }

  case_registration::RegisterOptions options_;
};

TEST_P(WindowStates, NoPageShowsWhatThePresentInputsDoNotGive) {
  ASSERT_NO_FATAL_FAILURE(change());
  std::string seen;
  for (const Phase phase : in_order) seen += std::string(seen.empty() ? "" : " ") + seen_on(phase);
  EXPECT_EQ(seen, GetParam().expected);
  expect_no_figure_that_is_out_of_date();
  screenshot(fmt::format("state-{}", GetParam().name).c_str());
  ASSERT_TRUE(wait_idle());
  ASSERT_NO_FATAL_FAILURE(measure_again());
  for (const Phase phase : in_order) EXPECT_EQ(card(phase).out_of_date.toStdString(), "");
  expect_as_measured_afresh();
}

// docs/desktop.md has the same table.
INSTANTIATE_TEST_SUITE_P(Table, WindowStates,
                         testing::Values(  //               Acq Rec Cal Reg Pla Nav Ver
                             InputChange{"PickMoved", "- - - . S . S", false},
                             InputChange{"PickTakenOtherwise", "- - - . S . S", false},
                             InputChange{"PickErased", "- - - . S . S", false},
                             InputChange{"PicksCleared", "- - - . S . S", false},
                             InputChange{"CalibratorChanged", "S S S . S S S", false},
                             InputChange{"PlateChanged", "S S S . S S S", false},
                             InputChange{"ImageOfAViewChanged", "S S S . S S S", false},
                             InputChange{"FrameOfAViewChanged", "S S S . S S S", false},
                             InputChange{"SettingsChanged", "- S S . S S S", false},
                             InputChange{"AnotherLayerShown", "- - - . - . -", false},
                             InputChange{"ModelMovedByHand", "- - - S S . .", true},
                             InputChange{"LandmarkMoved", "- - - S S . S", true},
                             InputChange{"LandmarkMovedInTheModel", "- - - S S . .", true},
                             InputChange{"ModelFileChanged", "S S S S S S S", true},
                             InputChange{"CalibratorChanged", "S S S S S S S", true},
                             InputChange{"SettingsChanged", "- S S S S S S", true}),
                         [](const auto& each) {
                           return std::string(each.param.name) + (each.param.has_model ? "WithAModel" : "");
                         });

}  // namespace
}  // namespace helicarm::gui
