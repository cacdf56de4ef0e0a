// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/kept_settings.h"

#include "helicarm/case_registration/register_fields.h"
#include "helicarm/devices/receiver/receiver_fields.h"
#include "helicarm/operation/plan_fields.h"
#include "helicarm/pipeline/map_cache.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/virtual_devices/virtual_devices_fields.h"

namespace helicarm::gui {
namespace {

/// Calls for each part of the settings, its fields and its name.
template <class Visit>
void for_each_part(const Visit& visit) {
  visit(&Settings::run, pipeline::run_fields, "run");
  visit(&Settings::search, case_registration::search_fields, "search");
  visit(&Settings::plan, operation::plan_fields, "plan");
  visit(&Settings::receiver, receiver::receiver_fields, "receiver");
  visit(&Settings::virtual_or, virtual_devices::virtual_devices_fields, "virtual_devices");
}

QString key_of(const char* part, std::string_view name) {
  return QString("settings/%1/%2").arg(part, QString::fromUtf8(name.data(), qsizetype(name.size())));
}

constexpr const char* unset = "unset";

}  // namespace

void keep_settings(QSettings& store, const Settings& settings) {
  store.remove("settings");
  for_each_part([&](auto part, const auto& fields, const char* name) {
    const Settings defaults;
    for (const auto& field : fields) {
      const std::optional<double> value = field.get(settings.*part);
      if (value == field.get(defaults.*part)) continue;
      store.setValue(key_of(name, field.name), value ? QString::number(*value, 'g', 17) : QString(unset));
    }
  });
}

Settings kept_settings(const QSettings& store) {
  Settings settings;
  settings.run.cache = pipeline::user_cache_folder();
  for_each_part([&](auto part, const auto& fields, const char* name) {
    for (const auto& field : fields) {
      const QString kept = store.value(key_of(name, field.name)).toString();
      if (kept.isEmpty()) continue;
      bool is_number = false;
      const double number = kept.toDouble(&is_number);
      if (!is_number && kept != unset) continue;
      const std::optional<double> value = is_number ? std::optional(number) : std::nullopt;
      if (check_number(field, value, "")) field.set(settings.*part, value);
    }
  });
  return settings;
}

}  // namespace helicarm::gui
