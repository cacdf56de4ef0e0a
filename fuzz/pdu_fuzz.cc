// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/dimse.h"
#include "helicarm/devices/receiver/negotiation.h"
#include "helicarm/devices/receiver/pdu.h"
#include "helicarm/devices/receiver/peer.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

void run_request(std::string_view body) {
  const auto request = receiver::dicom::read_association_request(body);
  if (!request) return;
  check(receiver::dicom::is_title(request->called) && receiver::dicom::is_title(request->calling),
        "titles are valid");
  check(request->contexts.size() <= 128, "no more contexts than can be numbered");
  for (const auto& context : request->contexts) {
    check(context.id % 2 == 1 && receiver::dicom::is_uid(context.abstract_syntax),
          "a context has its number and syntax");
    for (const auto& syntax : context.transfer_syntaxes)
      check(receiver::dicom::is_uid(syntax), "syntaxes are UIDs");
  }
  const auto answers = receiver::dicom::negotiate(*request, {});
  if (!answers) return;
  check(answers->size() == request->contexts.size(), "each context is answered");
  const std::string accept = receiver::dicom::associate_accept(*request, *answers, 1 << 17);
  const auto header = receiver::dicom::read_pdu_header(accept);
  check(header.type == 2 && header.length == accept.size() - receiver::dicom::pdu_header_bytes,
        "the answer has the right length");
}

void run_fragments(std::string_view body) {
  const auto fragments = receiver::dicom::read_fragments(body);
  if (!fragments) return;
  std::size_t total = 0;
  for (const auto& fragment : *fragments) total += 6 + fragment.bytes.size();
  check(total == body.size(), "fragments fill their PDU");
}

void run_command(std::string_view bytes) {
  const auto command = receiver::dicom::read_command(bytes);
  if (!command) return;
  check(command->sop_class.empty() || receiver::dicom::is_uid(command->sop_class), "the class is a UID");
  check(command->sop_instance.empty() || receiver::dicom::is_uid(command->sop_instance),
        "the instance is a UID");
  const std::string response =
      receiver::dicom::write_response(*command, receiver::dicom::Status::cannot_understand, "why\n");
  const auto again = receiver::dicom::read_command(response);
  check(again.has_value() && again->sop_class == command->sop_class && !again->data_set_follows &&
            again->field == (command->field | 0x8000) && again->sop_instance == command->sop_instance,
        "the response can be read and belongs to its command");
}

}  // namespace

void run(std::string_view bytes) {
  switch (Choices(bytes).byte() % 3) {
    case 0:
      return run_request(bytes);
    case 1:
      return run_fragments(bytes);
    default:
      return run_command(bytes);
  }
}

std::vector<std::string> seeds() {
  return {'\0' + receiver::peer::Request().body(),
          '\1' + receiver::peer::fragment(3, 3, receiver::peer::command(1, receiver::xa_class, "2.25.17")) +
              receiver::peer::fragment(3, 2, "data"),
          '\2' + receiver::peer::command(1, receiver::xa_class, "2.25.17"),
          '\2' + receiver::peer::command(0x30, receiver::verification_class)};
}

}  // namespace helicarm::fuzz
