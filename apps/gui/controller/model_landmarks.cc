// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/model_landmarks.h"

#include <QCoreApplication>
#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>

#include "helicarm/case_registration/plan.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/core/csv.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/pipeline/case_purpose.h"
#include "helicarm/registration/landmarks.h"

namespace helicarm::gui {
namespace fs = std::filesystem;
using pipeline::CaseModel;
using pipeline::PointInModel;

namespace {

using Points = std::vector<PointInModel>;

QString landmark_tr(const char* words) { return QCoreApplication::translate("Landmarks", words); }

QString in_words(const std::string& name) { return QString::fromStdString(name); }

constexpr int least_views = 2;  // whose rays meet in a point

/// NAME-landmarks.csv with the characters of a portable file name, numbered where another file has it.
std::string csv_name(const fs::path& case_folder, const CaseModel& of, const Json& model,
                     const std::map<std::string, std::string>& taken) {
  std::string name = of.name;
  // What it holds is not known where it cannot be read.
  const bool is_readable = guarded([&] { return case_registration::start_landmarks(of); }).has_value();
  for (char& c : name) {
    const bool is_good =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
    if (!is_good) c = '_';
  }
  constexpr std::size_t longest = 64;
  name.resize(std::min(name.size(), longest));
  const auto is_start = [&](const std::string& file) {
    return model.contains("start") && model["start"].is_object() &&
           model["start"].value("landmarks", Json()) == Json(file);
  };
  std::string file = name + "-landmarks.csv";
  const auto is_other = [&] {
    return taken.contains(file) || (fs::exists(case_folder / file) && !(is_readable && is_start(file)));
  };
  for (int number = 2; is_other(); ++number) file = fmt::format("{}-landmarks-{}.csv", name, number);
  return file;
}

std::string to_csv(const Points& landmarks) {
  std::string csv = "name,x_mm,y_mm,z_mm\n";
  for (const PointInModel& point : landmarks)  // the shortest digits that give the same number
    csv += fmt::format("{},{},{},{}\n", csv_field(point.name), point.in_model.x(), point.in_model.y(),
                       point.in_model.z());
  return csv;
}

/// The element of case.json's "models" of this name.
Json& model_in(Json& json, const std::string& name) {
  if (json.is_object() && json.contains("models") && json["models"].is_array())
    for (Json& model : json["models"])
      if (model.is_object() && model.value("name", Json()) == Json(name)) return model;
  throw BadInput(Reason::bad_value, fmt::format("case.json: \"models\" names no \"{}\" any more", name));
}

/// Names the file as the model's start. Returns what the user is told of it.
QString name_as_start(Json& model, const std::string& name, const std::string& file) {
  const bool had_pose = model.contains("start") && model["start"].is_object() &&
                        model["start"].contains("world_from_model") &&
                        !model["start"]["world_from_model"].is_null();
  model["start"] = Json{{"landmarks", file}};
  return (had_pose ? landmark_tr("The landmarks of %1 are saved in %2; they replace its \"world_from_model\" "
                                 "as the start.")
                   : landmark_tr("The landmarks of %1 are saved in %2, its start."))
      .arg(in_words(name), in_words(file));
}

bool is_end_or_target(const ApplicationState& state, const std::string& name) {
  return std::ranges::any_of(state.tunnels,
                             [&](const operation::OperationTunnel& tunnel) {
                               return tunnel.start == name || tunnel.end == name;
                             }) ||
         std::ranges::find(state.calibrator.targets, name, &phantom::CalibratorTarget::name) !=
             state.calibrator.targets.end();
}

bool has_point(const Points& points, const std::string& name) {
  return std::ranges::find(points, name, &PointInModel::name) != points.end();
}

}  // namespace

ModelLandmarks landmarks_of_models(const std::vector<CaseModel>& models) {
  ModelLandmarks landmarks;
  for (const CaseModel& model : models)
    landmarks.push_back(
        guarded([&] { return case_registration::start_landmarks(model); }).value_or(Points()));
  return landmarks;
}

OpenedLandmarks opened_landmarks(const pipeline::Case& the_case, bool keeps) {
  OpenedLandmarks opened{landmarks_of_models(the_case.models)};
  for (const CaseModel& model : the_case.models) {
    const auto plan =
        model.plan ? case_registration::read_plan(*model.plan) : Expected<case_registration::MarkupPlan>();
    opened.planned.push_back(plan ? plan->points : Points());
  }
  if (!keeps || the_case.models.empty()) return opened;
  auto unsaved = unsaved_landmarks(the_case.folder, the_case.models, opened.of_case);
  if (!unsaved)
    opened.unreadable = std::move(unsaved.error());
  else if (*unsaved && !are_same(**unsaved, opened.of_case))
    opened.unsaved = *std::move(unsaved);
  return opened;
}

int views_with(const std::vector<pipeline::Pick>& picks, const std::string& point) {
  std::set<std::string> views;
  for (const pipeline::Pick& pick : picks)
    if (pick.name == point) views.insert(pick.view);
  return int(views.size());
}

std::size_t count_usable(const Points& landmarks, const std::vector<pipeline::Pick>& picks) {
  return std::size_t(std::ranges::count_if(
      landmarks, [&](const PointInModel& point) { return views_with(picks, point.name) >= least_views; }));
}

QString not_saved_words(const std::string& model, std::size_t usable) {
  return landmark_tr(
             "The landmarks of %1 are not its start yet, since %2 of them are picked in two X-ray "
             "images, of %3 at least; they are kept in unsaved_landmarks.json.")
      .arg(in_words(model))
      .arg(usable)
      .arg(registration::least_landmarks);
}

Expected<SavedLandmarks> save_landmarks(const fs::path& case_folder, const std::vector<CaseModel>& models,
                                        const ModelLandmarks& placed, const ModelLandmarks& saved,
                                        const std::vector<pipeline::Pick>& picks) {
  return guarded([&] {
    SavedLandmarks done{saved, models, {}};
    done.saved.resize(models.size());
    const fs::path file = case_folder / "case.json";
    std::optional<Json> json;
    std::map<std::string, std::string> tables;  // by file
    for (std::size_t i = 0; i < models.size(); ++i) {
      const Points& points = of_model(placed, i);
      if (are_same(points, of_model(saved, i))) continue;
      const std::size_t usable = count_usable(points, picks);
      if (usable < registration::least_landmarks) {
        done.told.push_back(not_saved_words(models[i].name, usable));
        continue;
      }
      if (!json) json = value_or_throw(read_json(file));
      Json& model = model_in(*json, models[i].name);
      const std::string name = csv_name(case_folder, models[i], model, tables);
      done.told.push_back(name_as_start(model, models[i].name, name));
      done.saved[i] = points;
      done.models[i].landmarks = case_folder / name;
      done.models[i].world_from_model.reset();
      tables.emplace(name, to_csv(points));
    }
    if (json) {
      value_or_throw(pipeline::case_from_json(*json, "case.json", case_folder, pipeline::purpose_of(*json)));
      for (const auto& [name, table] : tables)
        value_or_throw(write_file_in_folder(case_folder / name, table));
      value_or_throw(write_file_in_folder(file, to_text(*json) + "\n"));
    }
    value_or_throw(keep_unsaved_landmarks(case_folder, models, placed, done.saved));
    return done;
  });
}

void start_from_landmarks(pipeline::Case& the_case, const ModelLandmarks& placed,
                          const std::vector<operation::ModelStart>& moved) {
  if (placed.size() != the_case.models.size()) return;
  const ModelLandmarks of_case = landmarks_of_models(the_case.models);
  for (std::size_t i = 0; i < placed.size(); ++i) {
    CaseModel& model = the_case.models[i];
    const bool is_moved = std::ranges::find(moved, model.name, &operation::ModelStart::model) != moved.end();
    if (is_moved || are_same(placed[i], of_case[i]) ||
        count_usable(placed[i], the_case.picks) < registration::least_landmarks)
      continue;
    model.placed_landmarks = placed[i];
    model.world_from_model.reset();
  }
}

QString why_no_landmark(const ApplicationState& state, std::size_t model, const std::string& name,
                        const std::optional<Eigen::Vector3d>& in_model) {
  constexpr double same_place_mm = 1;  // as the registration takes it
  if (name.empty()) return landmark_tr("A landmark needs a name.");
  for (std::size_t i = 0; i < state.planned_points.size(); ++i)
    for (const PointInModel& planned : state.planned_points[i])
      if (planned.name == name &&
          !(i == model && in_model && (planned.in_model - *in_model).norm() < same_place_mm))
        return landmark_tr("%1 is a point of a plan, elsewhere: give the landmark another name.")
            .arg(in_words(name));
  for (std::size_t i = 0; i < state.model_landmarks.size(); ++i)
    if (i != model && has_point(state.model_landmarks[i], name))
      return landmark_tr("%1 is a landmark of %2 already.")
          .arg(in_words(name), in_words(i < state.models.size() ? state.models[i].name : ""));
  if (!has_point(of_model(state.model_landmarks, model), name) && is_end_or_target(state, name))
    return landmark_tr("There is a point of this name already.");
  return {};
}

bool is_landmark_of_model(const ApplicationState& state, const std::string& name) {
  return std::ranges::any_of(state.model_landmarks,
                             [&](const Points& points) { return has_point(points, name); });
}

QString why_not_renamed(const ApplicationState& state, std::size_t model, const std::string& name) {
  if (is_end_or_target(state, name))
    return landmark_tr("%1 is the end of a tunnel or a target too: remove the landmark and add another one.")
        .arg(in_words(name));
  for (std::size_t i = 0; i < state.model_landmarks.size(); ++i)
    if (i != model && has_point(state.model_landmarks[i], name))
      return landmark_tr("%1 is a landmark of %2 too: remove it here and add another one.")
          .arg(in_words(name), in_words(i < state.models.size() ? state.models[i].name : ""));
  return {};
}

std::string free_landmark_name(const ApplicationState& state, std::size_t model, const std::string& prefix,
                               int from) {
  const auto is_taken = [&](const std::string& name) {
    return !why_no_landmark(state, model, name).isEmpty() ||
           has_point(of_model(state.model_landmarks, model), name) ||
           std::ranges::find(state.landmarks, name) != state.landmarks.end() ||
           views_with(state.picks, name) > 0;
  };
  for (int i = from;; ++i)
    if (const std::string name = fmt::format("{}{}", prefix, i); !is_taken(name)) return name;
}

QString landmark_start_words(const ApplicationState& state, std::size_t model) {
  const Points& placed = of_model(state.model_landmarks, model);
  if (placed.empty() || model >= state.models.size() ||
      are_same(placed, of_model(state.case_landmarks, model)))
    return {};
  const std::size_t usable = count_usable(placed, state.picks);
  const QString name = in_words(state.models[model].name);
  if (usable >= registration::least_landmarks)
    return landmark_tr("%1 starts from its %2 landmarks that are picked in two X-ray images.")
        .arg(name)
        .arg(usable);
  return landmark_tr(
             "%1: %2 of its placed landmarks are picked in two X-ray images, %3 more must be; "
             "until then it starts as case.json states.")
      .arg(name)
      .arg(usable)
      .arg(registration::least_landmarks - usable);
}

QString with_landmark_words(const QString& words, const ApplicationState& state) {
  QStringList lines{words};
  for (std::size_t i = 0; i < state.model_landmarks.size(); ++i)
    if (const QString start = landmark_start_words(state, i); !start.isEmpty()) lines << start;
  return lines.join('\n');
}

std::optional<std::string> landmark_moved_in_model(const ApplicationState& state, std::size_t model) {
  if (!state.registration || model >= state.registered_landmarks.size()) return std::nullopt;
  const Points &before = state.registered_landmarks[model], &now = of_model(state.model_landmarks, model);
  for (const registration::Landmark& used : state.registration->models[model].used_landmarks) {
    const auto then = std::ranges::find(before, used.name, &PointInModel::name);
    const auto present = std::ranges::find(now, used.name, &PointInModel::name);
    if (then == before.end()) continue;  // of another start
    if (present == now.end() || present->in_model != then->in_model) return used.name;
  }
  return std::nullopt;
}

void ask_for_landmarks(ApplicationState& state) {
  for (const Points& landmarks : state.model_landmarks) {
    if (count_usable(landmarks, state.picks) >= registration::least_landmarks) continue;
    for (const PointInModel& point : landmarks)
      if (!is_end_or_target(state, point.name) &&
          std::ranges::find(state.landmarks, point.name) == state.landmarks.end())
        state.landmarks.push_back(point.name);
  }
}

}  // namespace helicarm::gui
