// SPDX-License-Identifier: Apache-2.0
// Registration of the plan's models during an operation. Nothing is guided to a model's tunnel before a
// person has confirmed the registration.
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/operation/models.h"
#include "helicarm/operation/operation.h"
#include "helicarm/report/overlay.h"
#include "helicarm/xray/digest.h"

namespace helicarm::operation {
namespace {

constexpr std::uintmax_t most_report_bytes = std::uintmax_t{256} << 20;
constexpr const char* registration_folder = "registration";

/// Report and overlays of a registration, with their digests.
Digests write_with_digests(const case_registration::CaseRegistration& registration,
                           const std::filesystem::path& folder) {
  value_or_throw(case_registration::write_registration(registration, folder));
  std::vector<std::string> names{"registration.json", "report.html"};
  for (std::size_t i = 0; i < registration.loaded.views.size(); ++i)
    names.push_back(report::overlay_name(registration.loaded.views[i].name, i));
  Digests files;
  for (const std::string& name : names)
    files[name] = xray::digest(value_or_throw(read_file(folder / name, most_report_bytes)));
  return files;
}

/// The first refusal.
std::optional<Failure> refusal_of(const case_registration::CaseRegistration& registration) {
  if (registration.failure) return registration.failure;
  for (const case_registration::RegisteredModel& model : registration.models)
    if (model.registration.failure) return model.registration.failure;
  return std::nullopt;
}

}  // namespace

Expected<void> Operation::register_models(const std::vector<ModelStart>& starts,
                                          const std::function<void()>& check) {
  return guarded([&] {
    if (plan_.models.empty()) throw BadInput(Reason::usage, "the plan has no \"models\"");
    if (!result_ || !measured_case_) throw BadInput(Reason::usage, "no measurement yet");
    notify_(Step::measure, "registration of the plan's models");
    const auto progress = case_registration::progress_in_words(
        [&](const std::string& step) { notify_(Step::measure, step); },
        [&] {
          if (end_.stop_requested()) throw BadInput(Reason::interrupted, "the registration was stopped");
          check();
        });
    auto found =
        value_or_throw(operation::register_models(plan_, *measured_case_, *by_images_, progress, starts));
    const std::string folder = measured_case_->folder.filename().string() + "/" + registration_folder;
    const Digests files = write_with_digests(found, folder_ / folder);
    const std::string digest = xray::digest(to_text(operation::recorded(found)));
    record(record::Registered{folder, digest, files, starts});
    const auto ended = forget_registration();
    registered_digest_ = digest;
    registration_ = std::move(found);
    ++registrations_;
    const auto refusal = refusal_of(*registration_);
    gate_.registered(refusal);
    record_ended(ended);
    if (refusal) throw BadInput(*refusal);
  });
}

Expected<void> Operation::confirm_registration() {
  return guarded([&] {
    value_or_throw(gate_.confirmable());
    if (gate_.is_confirmed()) return;
    pipeline::Result with_models =
        value_or_throw(with_registration(*without_models_, *registration_, plan_, *measured_case_));
    if (with_models.failure) throw BadInput(*with_models.failure);
    record(record::RegistrationConfirmed{registered_digest_, who_});
    value_or_throw(gate_.confirm());
    result_ = newest_result_ = std::move(with_models);
  });
}

/// What was planned, guided and verified in the models' tunnels ends with their registration.
std::optional<record::GuidanceEnded> Operation::forget_registration() {
  auto ended = guidance_ended(record::GuidanceEndedBy::new_plan);
  registration_.reset();
  registered_digest_.clear();
  gate_.forget_registration(plan_.tunnels);
  if (gate_.guide()) ended.reset();  // of no model: it goes on
  result_ = without_models_;
  for (const OperationTunnel& tunnel : plan_.tunnels)
    if (tunnel.of_model) verifications_.erase(tunnel.name);
  return ended;
}

}  // namespace helicarm::operation
