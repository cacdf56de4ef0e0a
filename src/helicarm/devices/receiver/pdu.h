// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"

/// Protocol data units of the DICOM upper layer (PS3.8, 9.3); every length is checked.
namespace helicarm::receiver::dicom {

enum class PduType : std::uint8_t {
  associate_request = 1,
  associate_accept = 2,
  associate_reject = 3,
  data = 4,
  release_request = 5,
  release_answer = 6,
  abort = 7
};

inline constexpr std::size_t pdu_header_bytes = 6;
/// Peers must accept PDUs of this size: header, fragment, the longest command with two UIDs and a comment.
inline constexpr std::uint32_t least_pdu_bytes = 512;
inline constexpr std::string_view dicom_application = "1.2.840.10008.3.1.1.1";
inline constexpr std::string_view implicit_little_endian = "1.2.840.10008.1.2";

/// Identifies this implementation (PS3.7, D.3.3.2).
inline constexpr std::string_view implementation_name = "HELICARM_" HELICARM_VERSION;
inline constexpr std::string_view implementation_uid = "2.25.91283404923874650913245760233914825573";

struct PduHeader {
  std::uint8_t type;  ///< can be a value outside PduType
  std::uint32_t length;
};

/// `bytes` are the first six of a PDU.
PduHeader read_pdu_header(std::string_view bytes);

/// A proposed SOP class with its transfer syntaxes.
struct PresentationContext {
  std::uint8_t id;  ///< odd
  std::string abstract_syntax;
  std::vector<std::string> transfer_syntaxes;
};

struct AssociationRequest {
  std::uint16_t version = 0;
  std::string called;  ///< titles, without padding
  std::string calling;
  std::string application_context;
  std::vector<PresentationContext> contexts;
  std::uint32_t most_pdu_bytes = 0;  ///< largest PDU the peer accepts; 0: any
};

/// A-ASSOCIATE-RQ for one SOP class in implicit little endian, of which the requestor is the provider.
struct ProviderContext {
  std::uint8_t id;  ///< odd
  std::string_view abstract_syntax;
  std::uint32_t most_pdu_bytes;
};
std::string associate_request(std::string_view called, std::string_view calling,
                              const ProviderContext& context);

/// Body of A-ASSOCIATE-RQ. Refuses (truncated, bad_value) items that exceed it, invalid titles and UIDs,
/// context numbers that are even or duplicate, and more than 128 contexts.
Expected<AssociationRequest> read_association_request(std::string_view body);

enum class ContextResult : std::uint8_t {
  accepted = 0,
  abstract_syntax_unknown = 3,
  transfer_syntaxes_unknown = 4
};

struct ContextAnswer {
  std::uint8_t id;
  ContextResult result;
  std::string abstract_syntax;
  std::string transfer_syntax;
};

/// Of an association with one context.
struct AssociationAnswer {
  ContextResult result;
  std::uint32_t most_pdu_bytes;  ///< largest PDU the peer accepts; 0: any
};

/// Body of A-ASSOCIATE-AC. Refuses (truncated, bad_value) items that exceed it or an answer without a
/// context.
Expected<AssociationAnswer> read_association_answer(std::string_view body);

struct Rejection {
  std::uint8_t result;  ///< 1 permanent, 2 transient
  std::uint8_t source;  ///< 1 user, 2 association control, 3 presentation
  std::uint8_t reason;
};

enum class AbortReason : std::uint8_t { unspecified = 0, unknown_pdu = 1, unexpected_pdu = 2, bad_value = 6 };

/// Complete PDUs with headers.
std::string associate_accept(const AssociationRequest& request, const std::vector<ContextAnswer>& contexts,
                             std::uint32_t most_pdu_bytes);
std::string associate_reject(const Rejection& rejection);
std::string release_request();
std::string release_answer();
std::string abort(AbortReason reason);
/// One command as one fragment.
std::string command_data(std::uint8_t context, std::string_view command);
/// A data set in as many PDUs as the peer's largest size requires (at least 512 bytes; 0: any).
std::string data_set_data(std::uint8_t context, std::string_view data_set, std::uint32_t most_pdu_bytes);

/// A fragment of a command or of a data set; a view of the PDU.
struct Fragment {
  std::uint8_t context;
  bool command;
  bool last;
  std::string_view bytes;
};

/// Body of P-DATA-TF.
Expected<std::vector<Fragment>> read_fragments(std::string_view body);

/// 1 to 64 characters: numbers without signs, separated by points.
bool is_uid(std::string_view text);

/// 1 to 16 printable characters without a backslash, not all blank.
bool is_title(std::string_view text);

}  // namespace helicarm::receiver::dicom
