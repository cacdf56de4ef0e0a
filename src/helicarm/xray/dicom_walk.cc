// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>

#include <fmt/format.h>

#include "helicarm/xray/bytes.h"
#include "helicarm/xray/dicom_elements.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/plain_bytes.h"
#include "helicarm/xray/transfer_syntax.h"

namespace helicarm::xray {
namespace {

constexpr int max_depth = 64;
constexpr std::size_t max_elements = 20000;
constexpr std::size_t max_fragments = 200000;
constexpr std::uint32_t undefined = 0xFFFFFFFF;
constexpr std::uint32_t item_tag = 0xFFFEE000, item_end = 0xFFFEE00D, sequence_end = 0xFFFEE0DD;
constexpr std::size_t meta_start = 132;

constexpr std::string_view short_vrs = "AE AS AT CS DA DS DT FD FL IS LO LT PN SH SL SS ST TM UI UL US";
constexpr std::string_view long_vrs = "OB OD OF OL OV OW SQ SV UC UN UR UT UV";

bool listed(std::string_view vrs, std::string_view vr) {
  for (std::size_t i = 0; i < vrs.size(); i += 3)
    if (vrs.substr(i, 2) == vr) return true;
  return false;
}

bool is_capital(char c) { return c >= 'A' && c <= 'Z'; }

/// Whether an element's header at `at` has a known VR.
bool has_vr(std::string_view bytes, std::size_t at) {
  if (bytes.size() < 6 || at > bytes.size() - 6) return false;
  const std::string_view vr = bytes.substr(at + 4, 2);
  return listed(short_vrs, vr) || listed(long_vrs, vr);
}

struct Header {
  std::uint32_t tag;
  std::array<char, 2> vr;
  std::uint32_t length;
  std::string_view vr_text() const { return {vr.data(), 2}; }
};

/// By the rules of PS3.5; of a file that breaks one of them (`irregular`) by looser ones, which are those of
/// DCMTK. Lengths, nesting and counts are bounded alike.
class Walker {
 public:
  Walker(std::string_view bytes, DicomElements& into)
      : bytes_(bytes), into_(&into), loose_(!into.irregular.empty()) {}

  void file() {
    at_ = loose_ ? loose_meta() : meta();
    if (loose_) detect_syntax();
    const TransferSyntax& syntax = chosen_syntax();
    encapsulated_ = syntax.coding != Coding::native;
    if (syntax.deflated) inflate();
    big_endian_ = syntax.big_endian;
    into_->elements.clear();
    elements(bytes_.size(), false, explicit_vr_.value_or(syntax.explicit_vr), 0);
    if (loose_) put_in_order();
    if (into_->find(tags::pixel_data) && encapsulated_ && into_->fragments.empty())
      into_->refuse(Reason::bad_value, tags::pixel_data,
                    "is not encapsulated, but the transfer syntax says so");
    check_uids({tags::sop_class.number, tags::sop_instance.number, tags::study.number, tags::series.number,
                tags::frame_of_reference.number});
  }

  /// Of a sequence's value. `into` gives the origin for messages.
  std::vector<DicomElements> items(bool explicit_vr) {
    std::vector<DicomElements> items;
    const DicomElements about = *into_;
    while (at_ < bytes_.size()) {
      const Header next = header(explicit_vr, bytes_.size());
      if (next.tag == sequence_end) break;
      // What has no VR is walked here for the first time.
      if (next.tag != item_tag) refuse(Reason::bad_value, "an item of a sequence was expected");
      const bool delimited = next.length == undefined;
      if (!delimited) need(next.length, bytes_.size());
      into_ = &items.emplace_back(about);
      elements(delimited ? bytes_.size() : at_ + next.length, delimited, explicit_vr, 0);
      if (loose_) put_in_order();
    }
    return items;
  }

 private:
  [[noreturn]] void refuse(Reason reason, std::string_view problem) const {
    throw BadInput(reason, fmt::format("{}: byte {}: {}", into_->origin, at_, problem));
  }

  std::uint32_t number(std::size_t size, std::size_t end) {
    need(size, end);
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < size; ++i)
      value |= std::uint32_t{static_cast<unsigned char>(bytes_[at_ + i])}
               << 8 * (big_endian_ ? size - 1 - i : i);
    at_ += size;
    return value;
  }

  void need(std::size_t size, std::size_t end) const {
    if (size <= end - at_) return;
    if (size > bytes_.size() - at_)
      refuse(Reason::truncated,
             fmt::format("{} bytes announced, {} left in the file", size, bytes_.size() - at_));
    refuse(Reason::bad_value,
           fmt::format("{} bytes announced, {} left in the group or item", size, end - at_));
  }

  Header header(bool explicit_vr, std::size_t end) {
    Header header{number(2, end) << 16, {' ', ' '}, 0};
    header.tag |= number(2, end);
    if (!explicit_vr || header.tag >> 16 == 0xFFFE) {
      header.length = number(4, end);
    } else {
      need(2, end);
      header.vr = {bytes_[at_], bytes_[at_ + 1]};
      at_ += 2;
      if (listed(short_vrs, header.vr_text())) {
        header.length = number(2, end);
      } else if (listed(long_vrs, header.vr_text())) {
        number(2, end);
        header.length = number(4, end);
      } else if (loose_) {
        // Two capitals may be a VR of a later edition, which has the long form; others have the short one.
        const bool long_form = std::ranges::all_of(header.vr, is_capital);
        if (long_form) number(2, end);
        header.length = number(long_form ? 4 : 2, end);
        header.vr = {'U', 'N'};
      } else {
        refuse(Reason::bad_value, fmt::format("({:04X},{:04X}) has the unknown VR {}", header.tag >> 16,
                                              header.tag & 0xFFFF, quote(header.vr_text())));
      }
    }
    if (!loose_ && header.length != undefined && header.length % 2 != 0)
      refuse(Reason::bad_value, fmt::format("({:04X},{:04X}) has the odd length {}", header.tag >> 16,
                                            header.tag & 0xFFFF, header.length));
    return header;
  }

  std::string_view value(std::size_t length, std::size_t end) {
    need(length, end);
    at_ += length;
    return bytes_.substr(at_ - length, length);
  }

  void keep(const Header& header, std::string_view value) {
    if (!loose_ && !into_->elements.empty() && header.tag <= into_->elements.back().tag)
      refuse(Reason::bad_value, fmt::format("({:04X},{:04X}) is given twice or out of order",
                                            header.tag >> 16, header.tag & 0xFFFF));
    if (into_->elements.size() == max_elements)
      refuse(Reason::bad_value, fmt::format("more than {} elements", max_elements));
    into_->elements.push_back({header.tag, header.vr, value});
  }

  std::size_t meta() {
    if (bytes_.size() <= meta_start || bytes_.substr(128, 4) != "DICM")
      throw BadInput(Reason::not_an_image,
                     fmt::format("{}: not a DICOM file with a preamble", into_->origin));
    at_ = meta_start;
    const Header first = header(true, bytes_.size());
    if (first.tag != tags::meta_length.number || first.vr_text() != "UL" || first.length != 4)
      refuse(Reason::bad_value, "the meta group does not begin with its length");
    const std::uint32_t length = number(4, bytes_.size());
    need(length, bytes_.size());
    const std::size_t end = at_ + length;
    while (at_ < end) {
      const Header next = header(true, end);
      if (next.tag >> 16 != 2) refuse(Reason::bad_value, "the length of the meta group is wrong");
      keep(next, value(next.length, end));
    }
    check_uids({0x00020002, 0x00020003, tags::transfer_syntax.number});
    into_->transfer_syntax = uid(into_->find(tags::transfer_syntax));
    return end;
  }

  /// A meta group of any form, or none.
  std::size_t loose_meta() {
    at_ = bytes_.size() > meta_start && bytes_.substr(128, 4) == "DICM" ? meta_start
          : bytes_.starts_with("DICM")                                  ? 4
                                                                        : 0;
    while (bytes_.size() - at_ >= 8 && bytes_.substr(at_, 2) == std::string_view("\2\0", 2)) {
      const Header next = header(has_vr(bytes_, at_), bytes_.size());
      keep(next, value(next.length, bytes_.size()));
    }
    put_in_order();
    check_uids({tags::transfer_syntax.number});
    into_->transfer_syntax = uid(into_->find(tags::transfer_syntax));
    return at_;
  }

  /// The data set's first element shows whether it states VRs; the meta group may be missing or wrong.
  void detect_syntax() {
    const TransferSyntax* stated = transfer_syntax(into_->transfer_syntax);
    if (stated && (stated->coding != Coding::native || stated->deflated)) return;
    if (stated && stated->big_endian)
      refuse(Reason::unsupported, "a big-endian file that breaks the rules of DICOM");
    if (!stated && !into_->transfer_syntax.empty()) return;
    explicit_vr_ = has_vr(bytes_, at_);
    into_->transfer_syntax = *explicit_vr_ ? "1.2.840.10008.1.2.1" : "1.2.840.10008.1.2";
  }

  /// In ascending order; of an element that is given twice with one value, one.
  void put_in_order() {
    std::vector<DicomElement>& elements = into_->elements;
    std::ranges::stable_sort(elements, {}, &DicomElement::tag);
    for (std::size_t i = 1; i < elements.size(); ++i)
      if (elements[i].tag == elements[i - 1].tag && elements[i].value != elements[i - 1].value)
        refuse(Reason::bad_value, fmt::format("({:04X},{:04X}) is given twice, with different values",
                                              elements[i].tag >> 16, elements[i].tag & 0xFFFF));
    const auto again = std::ranges::unique(elements, {}, &DicomElement::tag);
    elements.erase(again.begin(), again.end());
  }

  static std::string_view uid(const DicomElement* element) {
    if (!element) return {};
    std::string_view text = element->value;
    if (text.ends_with('\0') || text.ends_with(' ')) text.remove_suffix(1);
    return text;
  }

  void check_uids(std::initializer_list<std::uint32_t> tags) const {
    for (std::uint32_t tag : tags) {
      const std::string_view text = uid(into_->find({tag, ""}));
      if (text.size() > 64 || text.find_first_not_of("0123456789.") != std::string_view::npos)
        into_->refuse(Reason::bad_value, {tag, "UID"},
                      fmt::format("is {}, must be at most 64 digits and points", quote(text)));
    }
  }

  const TransferSyntax& chosen_syntax() const {
    const std::string& uid = into_->transfer_syntax;
    if (uid.empty()) into_->refuse(Reason::bad_value, tags::transfer_syntax, "is missing");
    const TransferSyntax* syntax = transfer_syntax(uid);
    if (!syntax)
      into_->refuse(
          Reason::unsupported, tags::transfer_syntax,
          fmt::format("is {}{}; read are uncompressed, deflated, RLE, JPEG (processes 1, 2, 4 and 14), "
                      "JPEG-LS and JPEG 2000: convert the file, for example with gdcmconv --raw IN OUT",
                      uid, name_of_other_syntax(uid)));
    return *syntax;
  }

  void inflate() {
    into_->converted =
        std::make_shared<const std::string>(value_or_throw(inflated(bytes_.substr(at_), into_->origin)));
    bytes_ = *into_->converted;
    at_ = 0;
  }

  /// Elements up to `end` or, if `delimited`, up to the item's delimiter.
  void elements(std::size_t end, bool delimited, bool explicit_vr, int depth) {
    while (at_ < end) {
      if (loose_ && depth == 0 && bytes_.find_first_not_of('\0', at_) == bytes_.npos) return;  // padding
      const Header next = header(explicit_vr, end);
      if (delimited && next.tag == item_end) return;
      if (next.tag >> 16 <= 2 || next.tag >> 16 == 0xFFFE)
        refuse(Reason::bad_value,
               fmt::format("({:04X},{:04X}) is not allowed here", next.tag >> 16, next.tag & 0xFFFF));
      const std::size_t start = at_;
      body(next, end, explicit_vr, depth);
      if (depth == 0) keep(next, bytes_.substr(start, at_ - start));
    }
    if (delimited)
      refuse(end == bytes_.size() ? Reason::truncated : Reason::bad_value, "an item is not delimited");
  }

  void body(const Header& next, std::size_t end, bool explicit_vr, int depth) {
    const std::string_view vr = next.vr_text();
    if (next.length != undefined) {
      need(next.length, end);
      if (vr == "SQ")
        sequence(at_ + next.length, false, explicit_vr, depth + 1);
      else
        at_ += next.length;
    } else if (next.tag == tags::pixel_data.number && vr != "SQ" && encapsulated_) {
      pixel_fragments(end, depth);
    } else if (vr == "SQ" || vr == "UN" || vr == "  ") {
      sequence(end, true, explicit_vr && vr == "SQ", depth + 1);
    } else {
      refuse(Reason::bad_value,
             fmt::format("({:04X},{:04X}) of VR {} has no length", next.tag >> 16, next.tag & 0xFFFF, vr));
    }
  }

  void sequence(std::size_t end, bool delimited, bool explicit_vr, int depth) {
    if (depth > max_depth)
      refuse(Reason::bad_value, fmt::format("sequences nested deeper than {}", max_depth));
    while (at_ < end) {
      const Header next = header(explicit_vr, end);
      if (delimited && next.tag == sequence_end) return;
      if (next.tag != item_tag) refuse(Reason::bad_value, "an item of a sequence was expected");
      if (next.length != undefined) need(next.length, end);
      elements(next.length == undefined ? end : at_ + next.length, next.length == undefined, explicit_vr,
               depth);
    }
    if (delimited)
      refuse(end == bytes_.size() ? Reason::truncated : Reason::bad_value, "a sequence is not delimited");
  }

  void pixel_fragments(std::size_t end, int depth) {
    while (true) {
      const Header next = header(true, end);
      if (next.tag == sequence_end) return;
      if (next.tag != item_tag || next.length == undefined)
        refuse(Reason::bad_value, "a fragment of Pixel Data was expected");
      const std::string_view fragment = value(next.length, end);
      if (into_->fragments.size() == max_fragments)
        refuse(Reason::bad_value, "too many fragments of Pixel Data");
      if (depth == 0) into_->fragments.push_back(fragment);
    }
  }

  std::string_view bytes_;
  DicomElements* into_;
  std::size_t at_ = 0;
  bool loose_;
  bool encapsulated_ = false;
  bool big_endian_ = false;
  std::optional<bool> explicit_vr_;  ///< as seen, where it was looked for
};

DicomElements walked(std::string_view bytes, const std::string& origin, const std::string& irregular = {}) {
  DicomElements found;
  found.origin = origin;
  found.irregular = irregular;
  Walker(bytes, found).file();
  return found;
}

/// By the rules, or else loosely. A file that cannot be read loosely either fails by the rule it broke first.
DicomElements walked_or_loosely(std::string_view bytes, const std::string& origin) {
  const auto by_the_rules = guarded([&] { return walked(bytes, origin); });
  if (by_the_rules) return *by_the_rules;
  const Failure& broken = by_the_rules.error();
  const bool without_preamble = broken.reason == Reason::not_an_image;
  if (!looks_like_dicom(bytes) || (!without_preamble && broken.reason != Reason::bad_value))
    throw BadInput(broken);
  const auto loosely = guarded([&] {
    return walked(bytes, origin, without_preamble ? origin + ": there is no preamble" : broken.message);
  });
  if (loosely) return *loosely;
  throw BadInput(without_preamble ? loosely.error() : broken);
}

}  // namespace

bool looks_like_dicom(std::string_view bytes) {
  using namespace std::literals;
  if (bytes.size() > meta_start && bytes.substr(128, 4) == "DICM") return true;
  if (bytes.starts_with("DICM")) bytes.remove_prefix(4);
  const bool begins = bytes.starts_with("\2\0"sv) || bytes.starts_with("\x08\0"sv);
  return begins && bytes.size() >= 8 &&
         (has_vr(bytes, 0) || number_at(bytes, 4) <= bytes.size() - 8);  // VR, or a length that can be
}

Expected<DicomElements> walk_dicom(std::string_view bytes, const std::string& origin) {
  return guarded([&] {
    DicomElements found = walked_or_loosely(bytes, origin);
    if (!transfer_syntax(found.transfer_syntax)->big_endian) return found;
    const auto converted =
        std::make_shared<const std::string>(value_or_throw(as_little_endian(bytes, origin)));
    found = walked(*converted, origin);
    found.converted = converted;
    return found;
  });
}

std::vector<DicomElements> sequence_items(const DicomElements& of, DicomTag sequence) {
  const DicomElement* element = of.find(sequence);
  if (!element) return {};
  DicomElements about;
  about.origin = of.origin;
  about.transfer_syntax = of.transfer_syntax;
  about.irregular = of.irregular;
  // A sequence without its VR is in the implicit syntax, whatever the file's (PS3.5 6.2.2).
  const bool explicit_vr =
      transfer_syntax(of.transfer_syntax)->explicit_vr && element->vr == std::array{'S', 'Q'};
  return Walker(element->value, about).items(explicit_vr);
}

}  // namespace helicarm::xray
