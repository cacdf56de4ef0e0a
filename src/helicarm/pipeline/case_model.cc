// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>

#include "helicarm/pipeline/model_description.h"

namespace helicarm::pipeline {

void description::check_model_line(const JsonReader& reader, const ModelLine& tunnel,
                                   const std::optional<guidance::Bone>& bone,
                                   std::vector<CaseModel>& models) {
  const auto model = std::ranges::find(models, tunnel.model, &CaseModel::name);
  const auto refuse = [&](const char* key, const std::string& problem) {
    reader.refuse(Reason::bad_value, key, problem);
  };
  if (model == models.end()) refuse("model", fmt::format("\"{}\" is not one of \"models\"", tunnel.model));
  if (!model->plan)
    refuse("model", fmt::format("\"{}\" has no \"plan\", which holds the line", tunnel.model));
  if (bone && model->moves_with && *model->moves_with != *bone)
    refuse("bone", fmt::format("is \"{}\", but the model \"{}\" moves with \"{}\"", *bone, tunnel.model,
                               *model->moves_with));
  if (bone) model->moves_with = bone;
  if (tunnel.diameter_mm && !model->surface && !model->mask.file && !model->window_hu &&
      !model->tunnel_mask.file)
    refuse("diameter_mm", fmt::format("cannot be compared with the bone: give the model \"{}\" a \"mask\", "
                                      "\"window_hu\", \"tunnel_mask\" or a \"surface\"",
                                      tunnel.model));
}

Json to_json(const CaseModel& model, const std::filesystem::path& folder) {
  ToJson codec;
  description::describe_model(codec, model, folder, {});
  return std::move(codec.json);
}

}  // namespace helicarm::pipeline
