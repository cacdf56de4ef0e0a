// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "helicarm/core/files.h"
#include "helicarm/devices/receiver/association.h"
#include "helicarm/devices/receiver/peer.h"
#include "helicarm/xray/read_dicom.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

/// Splits the stream into PDUs as the socket does; a length beyond the input takes the rest.
void converse(receiver::Association& association, std::string_view bytes) {
  while (!association.over() && bytes.size() >= receiver::dicom::pdu_header_bytes) {
    Choices choices(bytes);
    const auto [type, length] =
        receiver::dicom::read_pdu_header(choices.take(receiver::dicom::pdu_header_bytes));
    const std::string_view body = choices.take(length);
    if (type < 1 || type > 7 || body.size() > association.most_pdu_bytes()) return;
    std::string_view answers;
    const std::string sent = association.take(type, body);
    for (answers = sent; !answers.empty();) {
      check(answers.size() >= receiver::dicom::pdu_header_bytes, "an answer is a PDU");
      const auto header =
          receiver::dicom::read_pdu_header(answers.substr(0, receiver::dicom::pdu_header_bytes));
      check(header.length <= answers.size() - receiver::dicom::pdu_header_bytes,
            "an answer is a complete PDU");
      answers.remove_prefix(receiver::dicom::pdu_header_bytes + header.length);
    }
  }
}

}  // namespace

void run(std::string_view bytes) {
  static const auto inbox = receiver::Inbox::open(folder() / "inbox").value();
  receiver::ReceiverOptions options;
  options.most_object_bytes = 4096;  // so that inputs reach the limit
  receiver::ReceiverShared shared(options, *inbox, {});
  const auto id = shared.admission
                      .connect(
                          "192.0.2.1", [] {}, receiver::Admission::Clock::now())
                      .value();
  {
    receiver::Association association(shared, "192.0.2.1", id);
    try {
      converse(association, bytes);
    } catch (const receiver::Breach& breach) {
      check(!breach.why.empty(), "a protocol violation has a reason");
    }
    check(!association.peer().empty(), "the peer has a name");
  }
  shared.admission.leave(id);
  check(shared.counters.bytes_on_the_way == 0, "all memory is released");
  std::uint64_t images = 0;
  for (const auto& entry : std::filesystem::directory_iterator(inbox->folder())) {
    if (entry.path().extension() != ".dcm") continue;
    ++images;
    check(xray::read_dicom(read_file(entry.path(), 1 << 20).value(), "stored", 1).has_value(),
          "stored images are readable");
    std::filesystem::remove(entry.path());
  }
  check(images == shared.counters.stored, "the number of stored images equals that of acknowledgements");
}

std::vector<std::string> seeds() {
  const std::string request = receiver::peer::Request().bytes(),
                    store = receiver::peer::store(xray::DicomBuilder());
  receiver::peer::Request committing;
  committing.contexts += receiver::peer::context(5, std::string(receiver::commitment_class),
                                                 std::string(receiver::dicom::implicit_little_endian));
  const auto element = receiver::dicom::element;
  const std::string reference =
      element(0xFFFEE000, element(0x00081150, receiver::xa_class) + element(0x00081155, "2.25.17"));
  return {committing.bytes() + store +
              receiver::peer::commit(element(0x00081195, "2.25.99") + element(0x00081199, reference)),
          request + receiver::peer::echo() + receiver::peer::release(),
          request + store + receiver::peer::release(),
          request + store + store + receiver::peer::echo() + receiver::peer::release(),
          request + receiver::peer::store(xray::DicomBuilder(), "2.25.18"),
          request + receiver::peer::pdu(7, std::string(4, '\0')),
          receiver::peer::Request{.called = receiver::peer::padded("OTHER")}.bytes()};
}

}  // namespace helicarm::fuzz
