// SPDX-License-Identifier: Apache-2.0
#include "gui/window/ct_body.h"

#include <QCoreApplication>

#include "gui/xray/text.h"
#include "helicarm/case_registration/load.h"

namespace helicarm::gui {
namespace {

struct CtBodyWords {
  Q_DECLARE_TR_FUNCTIONS(CtBody)
};

}  // namespace

CtBody body_of(const volume::Volume& ct, const pipeline::CaseModel& model) {
  auto voxels = value_or_throw(case_registration::body_in(ct, model));
  if (voxels.empty()) return {};
  const QString name = text(model.name);
  return {std::make_shared<const std::vector<std::uint8_t>>(std::move(voxels)),
          model.mask.file
              ? CtBodyWords::tr("%1: mask %2").arg(name, text(model.mask.file->filename().string()))
              : CtBodyWords::tr("%1: %2 HU or more").arg(name).arg(model.window_hu->x(), 0, 'f', 0)};
}

}  // namespace helicarm::gui
