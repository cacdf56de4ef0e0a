// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include "helicarm/core/reason_code.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/track/model_sequence.h"

namespace helicarm::track {
namespace {

using case_registration::RegisteredFrame;
using registration::Registration;

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// By rows; null for a number that is not one.
template <class Matrix>
Json numbers_json(const Matrix& matrix) {
  Json list = Json::array();
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    for (Eigen::Index column = 0; column < matrix.cols(); ++column)
      list.push_back(std::isfinite(matrix(row, column)) ? Json(matrix(row, column)) : Json(nullptr));
  return list;
}

template <class Matrix>
void take_numbers(Matrix& matrix, const Json& list) {
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) {
      const Json& value = list.at(std::size_t(row * matrix.cols() + column));
      matrix(row, column) = value.is_null() ? unknown : value.get<double>();
    }
}

Json json_of(const Registration& model) {
  Json json = {{"name", model.name},
               {"decision", int(model.decision)},
               {"failure", model.failure ? pipeline::to_json(*model.failure) : Json(nullptr)},
               {"warnings", Json::array()},
               {"rotation", numbers_json(model.world_from_model.rotation)},
               {"translation_mm", numbers_json(model.world_from_model.translation)},
               {"centre_mm", numbers_json(model.centre)},
               {"covariance", numbers_json(model.covariance)},
               {"by_scale", numbers_json(model.by_scale)},
               {"anywhere", model.anywhere},
               {"residual_px", Json::object()}};
  for (const Warning& warning : model.warnings) json["warnings"].push_back(pipeline::to_json(warning));
  for (const registration::RegisteredView& view : model.views)
    json["residual_px"][view.name] = view.residual_px;
  return json;
}

Failure failure_from(const Json& json) {
  const auto word = json.at("code").get<std::string>();
  const auto reason = reason_of(word);
  if (!reason) throw BadInput(Reason::bad_value, word + " is no code");
  Failure failure{*reason, json.at("message").get<std::string>()};
  if (!json.at("view").is_null()) failure.view = json.at("view").get<std::string>();
  for (const auto& [name, value] : json.at("figures").items())
    failure.figures[name] = value.is_null() ? unknown : value.get<double>();
  return failure;
}

Registration registration_from(const Json& json) {
  Registration model;
  model.name = json.at("name").get<std::string>();
  model.decision = registration::Decision(json.at("decision").get<int>());
  if (!json.at("failure").is_null()) model.failure = failure_from(json.at("failure"));
  for (const Json& warning : json.at("warnings")) model.warnings.push_back(failure_from(warning));
  take_numbers(model.world_from_model.rotation, json.at("rotation"));
  take_numbers(model.world_from_model.translation, json.at("translation_mm"));
  take_numbers(model.centre, json.at("centre_mm"));
  take_numbers(model.covariance, json.at("covariance"));
  if (json.contains("by_scale")) take_numbers(model.by_scale, json.at("by_scale"));
  model.anywhere = json.value("anywhere", false);
  for (const auto& [name, value] : json.at("residual_px").items()) {
    registration::RegisteredView& view = model.views.emplace_back();
    view.name = name;
    view.residual_px = value.is_null() ? unknown : value.get<double>();
  }
  return model;
}

}  // namespace

std::string frame_line(const RegisteredFrame& frame) {
  Json json = {{"frame", frame.frame}, {"models", Json::array()}};
  for (const Registration& model : frame.models) json["models"].push_back(json_of(model));
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::vector<RegisteredFrame> frames_from(const std::string& lines, const std::vector<std::string>& names,
                                         const std::vector<int>& frames) {
  std::vector<RegisteredFrame> read;
  std::size_t at = 0;
  for (const int frame : frames) {
    const std::size_t end = lines.find('\n', at);
    if (end == lines.npos) break;
    const auto json = parse_json(std::string_view(lines).substr(at, end - at), "frames.jsonl");
    if (!json) break;
    try {
      if (json->at("frame") != frame || json->at("models").size() != names.size()) break;
      RegisteredFrame made{frame, {}};
      for (const Json& model : json->at("models")) made.models.push_back(registration_from(model));
      read.push_back(std::move(made));
    } catch (const std::exception&) {
      break;  // Not a line of this program: it and what follows is computed again.
    }
    at = end + 1;
  }
  return read;
}

}  // namespace helicarm::track
