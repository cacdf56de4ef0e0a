// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/pdu.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "helicarm/core/big_endian.h"

namespace helicarm::receiver::dicom {
namespace {

constexpr std::size_t most_contexts = 128;
constexpr std::size_t title_bytes = 16;

enum Item : std::uint8_t {
  application_context_item = 0x10,
  requested_context_item = 0x20,
  answered_context_item = 0x21,
  abstract_syntax_item = 0x30,
  transfer_syntax_item = 0x40,
  user_information_item = 0x50,
  most_pdu_bytes_item = 0x51,
  implementation_item = 0x52,
  role_selection_item = 0x54,
  implementation_name_item = 0x55
};

/// Calls `use(type, content)` for each item.
template <class Use>
void each_item(std::string_view bytes, Use&& use) {
  BigEndianReader reader(bytes);
  while (reader.left() > 0) {
    const auto type = reader.take<std::uint8_t>();
    reader.take(1);
    const auto length = reader.take<std::uint16_t>();
    use(type, reader.take(length));
  }
}

std::string item(Item type, std::string_view content) {
  return BigEndianWriter()
      .put(std::uint8_t{type})
      .put<std::uint8_t>(0)
      .put(static_cast<std::uint16_t>(content.size()))
      .put(content)
      .bytes();
}

std::string pdu(PduType type, std::string_view body) {
  return BigEndianWriter()
      .put(static_cast<std::uint8_t>(type))
      .put<std::uint8_t>(0)
      .put(static_cast<std::uint32_t>(body.size()))
      .put(body)
      .bytes();
}

std::string uid_of(std::string_view content, std::string_view what) {
  while (content.ends_with('\0') || content.ends_with(' ')) content.remove_suffix(1);
  if (!is_uid(content)) throw BadInput(Reason::bad_value, fmt::format("{}: is not a valid UID", what));
  return std::string(content);
}

std::string title_of(std::string_view field, std::string_view what) {
  while (field.ends_with(' ') || field.ends_with('\0')) field.remove_suffix(1);
  while (field.starts_with(' ')) field.remove_prefix(1);
  if (!is_title(field))
    throw BadInput(Reason::bad_value, fmt::format("{}: is not a valid application entity title", what));
  return std::string(field);
}

PresentationContext context_of(std::string_view content) {
  BigEndianReader reader(content);
  PresentationContext context{reader.take<std::uint8_t>(), {}, {}};
  reader.take(3);
  each_item(reader.take(reader.left()), [&](std::uint8_t type, std::string_view name) {
    if (type == abstract_syntax_item)
      context.abstract_syntax = uid_of(name, "abstract syntax");
    else if (type == transfer_syntax_item)
      context.transfer_syntaxes.push_back(uid_of(name, "transfer syntax"));
  });
  if (context.id % 2 == 0 || context.abstract_syntax.empty() || context.transfer_syntaxes.empty())
    throw BadInput(Reason::bad_value,
                   fmt::format("presentation context {}: must be odd, with an abstract and a transfer syntax",
                               context.id));
  return context;
}

std::uint32_t most_pdu_bytes_of(std::string_view user_information) {
  std::uint32_t most = 0;
  each_item(user_information, [&](std::uint8_t type, std::string_view content) {
    if (type == most_pdu_bytes_item) most = BigEndianReader(content).take<std::uint32_t>();
  });
  return most;
}

std::string user_information(std::uint32_t most_pdu_bytes, std::string_view roles = {}) {
  return item(most_pdu_bytes_item, BigEndianWriter().put(most_pdu_bytes).bytes()) +
         item(implementation_item, implementation_uid) + std::string(roles) +
         item(implementation_name_item, implementation_name);
}

std::string fragment(std::uint8_t context, std::uint8_t control, std::string_view bytes) {
  return pdu(PduType::data, BigEndianWriter()
                                .put(static_cast<std::uint32_t>(bytes.size() + 2))
                                .put(context)
                                .put(control)
                                .put(bytes)
                                .bytes());
}

}  // namespace

bool is_uid(std::string_view text) {
  if (text.empty() || text.size() > 64) return false;
  bool digit_before = false;
  for (const char c : text) {
    const bool digit = c >= '0' && c <= '9';
    if (!digit && !(c == '.' && digit_before)) return false;
    digit_before = digit;
  }
  return digit_before;
}

bool is_title(std::string_view text) {
  return !text.empty() && text.size() <= title_bytes &&
         std::ranges::all_of(text, [](char c) { return c >= 0x20 && c < 0x7F && c != '\\'; }) &&
         text.find_first_not_of(' ') != std::string_view::npos;
}

PduHeader read_pdu_header(std::string_view bytes) {
  BigEndianReader reader(bytes);
  const auto type = reader.take<std::uint8_t>();
  reader.take(1);
  return {type, reader.take<std::uint32_t>()};
}

Expected<AssociationRequest> read_association_request(std::string_view body) {
  return guarded([&] {
    BigEndianReader reader(body);
    AssociationRequest request;
    request.version = reader.take<std::uint16_t>();
    reader.take(2);
    request.called = title_of(reader.take(title_bytes), "called title");
    request.calling = title_of(reader.take(title_bytes), "calling title");
    reader.take(32);
    each_item(reader.take(reader.left()), [&](std::uint8_t type, std::string_view content) {
      if (type == application_context_item) {
        request.application_context = uid_of(content, "application context");
      } else if (type == requested_context_item) {
        request.contexts.push_back(context_of(content));
        const auto same = [&](const PresentationContext& c) { return c.id == request.contexts.back().id; };
        if (request.contexts.size() > most_contexts || std::ranges::count_if(request.contexts, same) > 1)
          throw BadInput(Reason::bad_value,
                         fmt::format("presentation context {}: given twice, or more than {}",
                                     request.contexts.back().id, most_contexts));
      } else if (type == user_information_item) {
        request.most_pdu_bytes = most_pdu_bytes_of(content);
      }
    });
    return request;
  });
}

std::string associate_request(std::string_view called, std::string_view calling,
                              const ProviderContext& context) {
  const std::string syntaxes = item(abstract_syntax_item, context.abstract_syntax) +
                               item(transfer_syntax_item, implicit_little_endian);
  const std::string provider = BigEndianWriter()
                                   .put(static_cast<std::uint16_t>(context.abstract_syntax.size()))
                                   .put(context.abstract_syntax)
                                   .put(std::uint8_t{0})
                                   .put(std::uint8_t{1})
                                   .bytes();
  return pdu(
      PduType::associate_request,
      BigEndianWriter()
          .put<std::uint16_t>(1)
          .put<std::uint16_t>(0)
          .put_name(called, title_bytes, ' ')
          .put_name(calling, title_bytes, ' ')
          .put_name({}, 32)
          .put(item(application_context_item, dicom_application))
          .put(item(requested_context_item, std::string{static_cast<char>(context.id), 0, 0, 0} + syntaxes))
          .put(item(user_information_item,
                    user_information(context.most_pdu_bytes, item(role_selection_item, provider))))
          .bytes());
}

Expected<AssociationAnswer> read_association_answer(std::string_view body) {
  return guarded([&] {
    BigEndianReader reader(body);
    reader.take(4 + 2 * title_bytes + 32);
    std::optional<ContextResult> result;
    std::uint32_t most_pdu_bytes = 0;
    each_item(reader.take(reader.left()), [&](std::uint8_t type, std::string_view content) {
      if (type == user_information_item) most_pdu_bytes = most_pdu_bytes_of(content);
      if (type != answered_context_item) return;
      BigEndianReader answer(content);
      answer.take(2);
      result = ContextResult{answer.take<std::uint8_t>()};
    });
    if (!result) throw BadInput(Reason::bad_value, "the association's answer has no context");
    if (most_pdu_bytes != 0 && most_pdu_bytes < least_pdu_bytes)
      throw BadInput(Reason::bad_value,
                     fmt::format("the peer accepts PDUs of {} bytes only", most_pdu_bytes));
    return AssociationAnswer{*result, most_pdu_bytes};
  });
}

std::string associate_accept(const AssociationRequest& request, const std::vector<ContextAnswer>& contexts,
                             std::uint32_t most_pdu_bytes) {
  BigEndianWriter body;
  body.put<std::uint16_t>(1).put<std::uint16_t>(0);
  body.put_name(request.called, title_bytes, ' ').put_name(request.calling, title_bytes, ' ');
  body.put_name({}, 32).put(item(application_context_item, request.application_context));
  for (const ContextAnswer& context : contexts)
    body.put(item(answered_context_item, BigEndianWriter()
                                             .put(context.id)
                                             .put<std::uint8_t>(0)
                                             .put(static_cast<std::uint8_t>(context.result))
                                             .put<std::uint8_t>(0)
                                             .put(item(transfer_syntax_item, context.transfer_syntax))
                                             .bytes()));
  body.put(item(user_information_item, user_information(most_pdu_bytes)));
  return pdu(PduType::associate_accept, body.bytes());
}

std::string associate_reject(const Rejection& rejection) {
  return pdu(PduType::associate_reject, BigEndianWriter()
                                            .put<std::uint8_t>(0)
                                            .put(rejection.result)
                                            .put(rejection.source)
                                            .put(rejection.reason)
                                            .bytes());
}

std::string release_request() { return pdu(PduType::release_request, std::string(4, '\0')); }

std::string release_answer() { return pdu(PduType::release_answer, std::string(4, '\0')); }

std::string abort(AbortReason reason) {
  constexpr std::uint16_t by_provider = 2;
  return pdu(PduType::abort, BigEndianWriter()
                                 .put<std::uint16_t>(0)
                                 .put(static_cast<std::uint16_t>(by_provider << 8 | static_cast<int>(reason)))
                                 .bytes());
}

std::string command_data(std::uint8_t context, std::string_view command) {
  constexpr std::uint8_t last_of_command = 3;
  return fragment(context, last_of_command, command);
}

std::string data_set_data(std::uint8_t context, std::string_view data_set, std::uint32_t most_pdu_bytes) {
  constexpr std::uint32_t usual_pdu_bytes = 16384, fragment_header_bytes = 6;
  const std::size_t most =
      std::min(most_pdu_bytes == 0 ? usual_pdu_bytes : std::max(most_pdu_bytes, least_pdu_bytes),
               usual_pdu_bytes) -
      fragment_header_bytes;
  std::string pdus;
  do {
    const std::string_view part = data_set.substr(0, most);
    data_set.remove_prefix(part.size());
    pdus += fragment(context, data_set.empty() ? 2 : 0, part);
  } while (!data_set.empty());
  return pdus;
}

Expected<std::vector<Fragment>> read_fragments(std::string_view body) {
  return guarded([&] {
    std::vector<Fragment> fragments;
    BigEndianReader reader(body);
    while (reader.left() > 0) {
      const auto length = reader.take<std::uint32_t>();
      if (length < 2) throw BadInput(Reason::bad_value, "a fragment is shorter than its header");
      BigEndianReader value(reader.take(length));
      const auto context = value.take<std::uint8_t>();
      const auto control = value.take<std::uint8_t>();
      fragments.push_back({context, (control & 1) != 0, (control & 2) != 0, value.take(value.left())});
    }
    return fragments;
  });
}

}  // namespace helicarm::receiver::dicom
