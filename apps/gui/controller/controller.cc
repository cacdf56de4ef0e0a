// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/controller.h"

#include <QTime>
#include <algorithm>

#include <fmt/format.h>

#include "gui/controller/equipment.h"
#include "gui/controller/pick_checks.h"
#include "gui/controller/stale.h"
#include "gui/controller/steps.h"
#include "gui/replay/pdf_report.h"
#include "helicarm/case_registration/dicom_measurements.h"
#include "helicarm/case_registration/measure_case.h"
#include "helicarm/case_registration/register_fields.h"
#include "helicarm/core/files.h"
#include "helicarm/report/earlier_results.h"
#include "helicarm/report/exports.h"
#include "helicarm/report/report.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

constexpr int look_for_images_ms = 100;

void forget_measurement(ApplicationState& state) {
  state.measured = false;
  state.order.reset();
  state.path = {};
  state.outcomes.clear();
  state.refusals.clear();
  state.measured_picks.clear();
}

void forget_registration(ApplicationState& state) {
  state.registration.reset();
  state.is_confirmed = false;
  state.at_starts.reset();
  state.nudged.reset();
  state.starts_by_hand.clear();
}

/// Writes the DICOM report and registrations if images and volumes are of DICOM; returns what went wrong.
QString dicom_written(const Equipment& equipment, const case_registration::Measurement& measured,
                      const fs::path& folder, const fs::path& registrations) {
  fs::remove(folder / report::dicom_measurements_name);
  const std::optional<pipeline::Case>& the_case =
      equipment.operation ? equipment.operation->measured_case() : equipment.the_case;
  if (measured.result.failure || !the_case) return {};
  const auto written = case_registration::write_available_dicom(*the_case, measured, folder, registrations);
  return written ? QString() : Controller::tr("the DICOM report: %1").arg(sentence_of(written.error()));
}

/// As `helicarm run` does; returns what could not be written.
QString write_measured(const Equipment& equipment, const pipeline::Result& result,
                       const std::optional<case_registration::CaseRegistration>& registration,
                       const fs::path& folder) {
  const pipeline::Result whole =
      registration ? case_registration::with_models(result, *registration) : result;
  report::forget_exports(folder);
  value_or_throw(write_pdf_report(whole, folder / "report.pdf"));
  if (!whole.failure) value_or_throw(report::write_exports(whole, folder));
  value_or_throw(case_registration::write_models(registration, folder));
  const QString lack = dicom_written(equipment, {whole, registration}, folder, folder / "registration");
  value_or_throw(report::write_result(whole, folder));
  return lack;
}

/// As `helicarm register` does, of views that bring cameras; returns what could not be written.
QString write_registered(const Equipment& equipment, const case_registration::CaseRegistration& registration,
                         const fs::path& folder) {
  report::forget_registration(folder);
  value_or_throw(case_registration::write_registration(registration, folder));
  return dicom_written(equipment, {case_registration::with_models({}, registration), registration}, folder,
                       folder);
}

}  // namespace

Controller::Controller(QObject* parent) : QObject(parent) {
  connect(&images_, &QTimer::timeout, this, &Controller::take_waiting_image);
  images_.start(look_for_images_ms);
  const auto note_change = [this](const QString& path) {
    if (!watched_.contains(path)) return;  // of an earlier case
    state_.changed_file = path.toStdString();
    emit changed();
  };
  connect(&files_, &QFileSystemWatcher::fileChanged, this, note_change);
  connect(&files_, &QFileSystemWatcher::directoryChanged, this, note_change);
}

Controller::~Controller() {
  stop();
  if (equipment_ && equipment_->operation) equipment_->operation->interrupt();
}

void Controller::begin(Phase phase, std::string doing, std::function<Change()> work) {
  if (state_.busy) return;
  state_.busy = phase;
  state_.doing = std::move(doing);
  state_.refusals.erase(phase);
  if (equipment_) equipment_->stopped = false;
  emit changed();
  worker_.post([this, phase, work = std::move(work), equipment = equipment_, order = state_.order] {
    const operation::Operation* operation = equipment ? equipment->operation.get() : nullptr;
    const MeasuredImages before = operation ? measured_images(*operation) : MeasuredImages();
    const auto done = guarded([&]() -> Change {
      try {
        return work();
      } catch (const BadInput&) {
        throw;
      } catch (const std::exception& problem) {
        throw BadInput(Reason::unsupported, fmt::format("unexpected: {}", problem.what()));
      }
    });
    if (!done && operation) meanwhile(held_after(*equipment, before, order));
    QMetaObject::invokeMethod(
        this, [this, phase, done] { finish(phase, done); }, Qt::QueuedConnection);
  });
}

Controller::Change Controller::held_after(const Equipment& equipment, const MeasuredImages& before,
                                          const std::optional<robot::RobotOrder>& order) {
  const operation::Operation& operation = *equipment.operation;
  const MeasuredImages after = measured_images(operation);
  const bool forgot = after != before && !after.have_result;
  const auto images = forgot ? images_of(operation) : Images();
  const auto live = operation.live_tool();
  return [this, forgot, images, live = live ? std::optional(*live) : std::nullopt,
          is_registered = operation.registration().has_value(), is_confirmed = operation.is_confirmed(),
          order_is_void = order && !operation.is_planned(*order)](ApplicationState& state) {
    if (forgot) {
      forget_measurement(state);
      if (images) state.result = result_with(*images);
      state.failed_picks = failed_picks(state, {});
    }
    if (state.registration && !is_registered) {
      forget_registration(state);
      forget_registrations();
    }
    state.is_confirmed = is_confirmed;
    if (order_is_void && std::exchange(state.order, std::nullopt)) state.path = {};
    live_tool_ = live;
  };
}

void Controller::finish(Phase phase, const Expected<Change>& done) {
  state_.busy.reset();
  state_.doing.clear();
  if (const auto open_next = std::exchange(next_source_, nullptr)) {
    emit changed();  // the work has ended before the next one begins
    measures_again_ = false;
    return open_next();
  }
  if (done)
    (*done)(state_);
  else
    state_.refusals.insert_or_assign(phase, done.error());
  if (!done && phase == Phase::registration && done.error().reason != Reason::interrupted)
    registers_recorded_ = false;
  if (!outlining_) outline_nudged();
  emit changed();
  if (!done) emit refused(phase, sentence_of(done.error()));
  if (std::exchange(measures_again_, false)) measure();
  follow_record();
}

void Controller::meanwhile(Change change) {
  QMetaObject::invokeMethod(
      this,
      [this, change = std::move(change)] {
        change(state_);
        emit changed();
      },
      Qt::QueuedConnection);
}

void Controller::show_step(const std::string& step) {
  meanwhile([this, step](ApplicationState& state) {
    if (!equipment_ || !equipment_->stopped) state.doing = step;
  });
}

void Controller::set_options(const case_registration::RegisterOptions& options) {
  const bool differ = !case_registration::give_the_same(options_, options);
  options_ = options;
  if (!differ || state_.source != Source::files || !state_.result || state_.is_replayed) return;
  state_.has_other_options = true;
  emit changed();
  measure();
}

void Controller::expect(const std::string& view) {
  state_.next_view = view;
  emit changed();
}

void Controller::shoot(const std::string& view) {
  if (!equipment_ || !equipment_->virtual_or) return;
  begin(Phase::acquire, "acquiring " + view,
        [this, view, equipment = equipment_]() -> Change { return came(shoot_and_take(*equipment, view)); });
}

void Controller::take_waiting_image() {
  const bool is_guiding = state_.drill && state_.busy == Phase::navigate;
  if (is_guiding && equipment_ && equipment_->devices->next_image(0))
    return emit told(
        tr("An image that came while the drill is guided is kept in the session and not used: end the "
           "guidance, then acquire it again."));
  if (state_.busy || !equipment_ || !equipment_->operation) return;
  const auto view_image = equipment_->devices->next_image(0);
  if (!view_image) return;
  begin(Phase::acquire, "image received",
        [this, view = state_.next_view, equipment = equipment_, view_image]() -> Change {
          return came(take(*equipment, view, *view_image));
        });
}

Controller::Change Controller::came(const Expected<Images>& images) {
  return [this, images = value_or_throw(images)](ApplicationState& state) {
    forget_measurement(state);
    forget_registration(state);
    forget_registrations();
    live_tool_.reset();  // its lines belong to the previous images
    state.result = result_with(images);
    state.failed_picks = failed_picks(state, {});
    state.next_view = missing_view(state);
    if (has_all_images()) QMetaObject::invokeMethod(this, &Controller::measure, Qt::QueuedConnection);
  };
}

Controller::Change Controller::measured(Equipment& equipment, const std::vector<pipeline::Pick>& picks) {
  const auto calibration = [&] {
    return equipment.measurement ? equipment.measurement->calibration : nullptr;
  };
  const auto earlier = calibration();
  auto result = std::make_shared<const pipeline::Result>(value_or_throw(gui::measure(equipment, picks)));
  const bool other_models = !earlier || calibration() != earlier ||
                            (equipment.registered_by &&
                             !case_registration::give_the_same(*equipment.registered_by, equipment.options));
  std::optional<operation::LiveTool> live;
  if (equipment.operation && !result->failure)
    if (auto follows = equipment.operation->live_tool()) live = *std::move(follows);
  return [this, result, live, other_models, picks, options = equipment.options,
          is_recorded = equipment.is_recorded](ApplicationState& state) {
    forget_measurement(state);
    state.measured_picks = picks;
    state.has_other_options = !is_recorded && !case_registration::give_the_same(options_, options);
    if (other_models || result->failure) {
      forget_registration(state);
      forget_registrations();
    }
    state.result = result;
    state.failed_picks = failed_picks(state, state.failed_picks);
    ++state.measurements;
    // A refused tunnel leaves the calibration: its ends can be picked again.
    state.measured =
        !result->views.empty() && std::ranges::all_of(result->views, [](const pipeline::ViewResult& view) {
          return view.calibrated.has_value();
        });
    if (result->failure)
      state.refusals.insert_or_assign(phase_of(result->refused_at.value_or(pipeline::Stage::calibrate)),
                                      *result->failure);
    live_tool_ = live;
  };
}

void Controller::measure_again() {
  if (state_.changed_file.empty()) return measure();
  if (state_.is_replayed) return open_recorded();
  open_case(state_.folder, state_.case_folder.has_value());
}

void Controller::measure() {
  if (!equipment_ || (!equipment_->the_case && !equipment_->operation)) return;
  measures_again_ = state_.busy.has_value();
  begin(Phase::calibrate, "measuring",
        [this, equipment = equipment_, picks = state_.picks, options = options_] {
          if (!equipment->is_recorded) equipment->options = options;
          return measured(*equipment, picks);
        });
}

bool Controller::has_all_images() const {
  return state_.result && std::ranges::all_of(state_.result->views, [](const pipeline::ViewResult& view) {
           return view.xray_image != nullptr;
         });
}

void Controller::cancel() {
  if (!state_.busy || !equipment_) return;
  if (equipment_->devices && state_.busy == Phase::navigate) return stop();  // the robot too
  if (state_.busy == Phase::registration) registers_recorded_ = false;
  if (equipment_->stopped.exchange(true)) return;
  state_.doing = "cancelling: " + state_.doing;
  emit changed();
}

void Controller::export_to(const fs::path& folder) {
  if (!state_.measured) {
    emit refused(Phase::verify, tr("Nothing to export: measure first."));
    return;
  }
  const bool has_cameras = !state_.cameras.empty();
  if (has_cameras && !state_.registration)
    return emit refused(Phase::verify, tr("Nothing to export: register the models first (Alt+7)."));
  if (state_.busy)
    return emit refused(*state_.busy, tr("Nothing is exported during other work (%1): export again after it.")
                                          .arg(QString::fromStdString(state_.doing)));
  if (state_.has_other_options || !state_.changed_file.empty())
    return emit refused(Phase::verify,
                        tr("Nothing is exported: %1. Measure again (F5).").arg(stale(state_, Phase::verify)));
  pipeline::Result result = *state_.result;
  for (const auto& [tunnel, outcome] : state_.outcomes)
    if (outcome.verification) result.verifications.push_back(*outcome.verification);
  ExportRecord record{folder,
                      QTime::currentTime().toString("HH:mm"),
                      lacks_of_export(state_),
                      state_.result,
                      state_.registration,
                      state_.picks};
  std::optional<case_registration::CaseRegistration> registration;
  if (state_.registration) registration = present_registration(state_);
  begin(Phase::verify, "writing the report",
        [this, equipment = equipment_, result = std::move(result), registration = std::move(registration),
         folder, record = std::move(record), has_cameras]() mutable -> Change {
          const QString lack = has_cameras ? write_registered(*equipment, *registration, folder)
                                           : write_measured(*equipment, result, registration, folder);
          if (!lack.isEmpty()) record.lacks << lack;
          return [this, record](ApplicationState& state) {
            state.exported = record;
            emit exported(QString::fromStdString(record.folder.string()));
          };
        });
}

void Controller::set_fault(const std::string& name, bool on) {
  if (!equipment_ || !equipment_->virtual_or) return;
  if (const auto of_c_arm = virtual_devices::c_arm_fault(name)) {
    equipment_->c_arm_fault = on ? *of_c_arm : virtual_devices::CArmFault::none;
    return;
  }
  faults_.start(
      [equipment = equipment_, name, on] { static_cast<void>(equipment->virtual_or->set_fault(name, on)); });
}

void Controller::move_bone(const std::string& bone, const Eigen::Vector3d& shift_mm) {
  if (equipment_ && equipment_->virtual_or)
    equipment_->virtual_or->simulated_scene().move_bone(bone, {Eigen::Matrix3d::Identity(), shift_mm});
}

}  // namespace helicarm::gui
