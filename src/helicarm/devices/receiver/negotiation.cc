// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/negotiation.h"

#include <algorithm>
#include <array>

#include "helicarm/devices/receiver/commitment.h"
#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/transfer_syntax.h"

namespace helicarm::receiver::dicom {
namespace {

constexpr std::string_view verification = "1.2.840.10008.1.1";

constexpr Rejection version_not_supported{1, 2, 2};
constexpr Rejection application_not_supported{1, 1, 2};
constexpr Rejection calling_title_unknown{1, 1, 3};
constexpr Rejection called_title_unknown{1, 1, 7};
constexpr Rejection no_reason_given{1, 1, 1};

ContextAnswer answer(const PresentationContext& context) {
  ContextAnswer answer{context.id, ContextResult::accepted, context.abstract_syntax,
                       context.transfer_syntaxes.front()};
  if (context.abstract_syntax == commitment_class) {
    answer.transfer_syntax = implicit_little_endian;
    if (std::ranges::count(context.transfer_syntaxes, implicit_little_endian) == 0)
      answer.result = ContextResult::transfer_syntaxes_unknown;
    return answer;
  }
  if (context.abstract_syntax != verification && !xray::is_xray_class(context.abstract_syntax)) {
    answer.result = ContextResult::abstract_syntax_unknown;
    return answer;
  }
  const auto best = std::ranges::find_if(xray::transfer_syntaxes, [&](const xray::TransferSyntax& syntax) {
    return std::ranges::count(context.transfer_syntaxes, syntax.uid) > 0;
  });
  if (best == xray::transfer_syntaxes.end())
    answer.result = ContextResult::transfer_syntaxes_unknown;
  else
    answer.transfer_syntax = best->uid;
  return answer;
}

}  // namespace

tl::expected<std::vector<ContextAnswer>, Rejection> negotiate(const AssociationRequest& request,
                                                              const NegotiationOptions& options) {
  if ((request.version & 1) == 0) return tl::unexpected(version_not_supported);
  if (request.application_context != dicom_application) return tl::unexpected(application_not_supported);
  if (request.called != options.title) return tl::unexpected(called_title_unknown);
  if (!options.peers.empty() && std::ranges::count(options.peers, request.calling) == 0)
    return tl::unexpected(calling_title_unknown);
  if (request.contexts.empty() || (request.most_pdu_bytes != 0 && request.most_pdu_bytes < least_pdu_bytes))
    return tl::unexpected(no_reason_given);
  std::vector<ContextAnswer> answers;
  for (const PresentationContext& context : request.contexts) answers.push_back(answer(context));
  return answers;
}

}  // namespace helicarm::receiver::dicom
