// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

namespace helicarm::xray {

/// How Pixel Data are stored.
enum class Coding { native, rle, deflated_frames, jpeg, jpeg_lossless, jpeg_ls, jpeg_2000 };

struct TransferSyntax {
  std::string_view uid;
  Coding coding = Coding::native;
  bool may_be_lossy = false;
  bool explicit_vr = true;
  bool big_endian = false;
  bool deflated = false;
};

/// All that are read, in the order of preference: cheapest to decode first, lossy ones last.
inline constexpr std::array transfer_syntaxes = {
    TransferSyntax{"1.2.840.10008.1.2.1"},
    TransferSyntax{.uid = "1.2.840.10008.1.2", .explicit_vr = false},
    TransferSyntax{"1.2.840.10008.1.2.5", Coding::rle},
    TransferSyntax{"1.2.840.10008.1.2.8.1", Coding::deflated_frames},
    TransferSyntax{"1.2.840.10008.1.2.4.70", Coding::jpeg_lossless},
    TransferSyntax{"1.2.840.10008.1.2.4.57", Coding::jpeg_lossless},
    TransferSyntax{"1.2.840.10008.1.2.4.80", Coding::jpeg_ls},
    TransferSyntax{"1.2.840.10008.1.2.4.90", Coding::jpeg_2000},
    TransferSyntax{.uid = "1.2.840.10008.1.2.1.99", .deflated = true},
    TransferSyntax{.uid = "1.2.840.10008.1.2.2", .big_endian = true},
    TransferSyntax{"1.2.840.10008.1.2.4.81", Coding::jpeg_ls, true},
    TransferSyntax{"1.2.840.10008.1.2.4.91", Coding::jpeg_2000, true},
    TransferSyntax{"1.2.840.10008.1.2.4.51", Coding::jpeg, true},
    TransferSyntax{"1.2.840.10008.1.2.4.50", Coding::jpeg, true}};

/// Null for those that are not read.
inline const TransferSyntax* transfer_syntax(std::string_view uid) {
  const auto found = std::ranges::find(transfer_syntaxes, uid, &TransferSyntax::uid);
  return found == transfer_syntaxes.end() ? nullptr : &*found;
}

/// Of one that is not read, for a message: " (MPEG-4)"; empty where it has no common name.
inline std::string_view name_of_other_syntax(std::string_view uid) {
  constexpr std::string_view family = "1.2.840.10008.1.2.4.";
  constexpr std::array<std::pair<std::string_view, std::string_view>, 10> names = {
      {{"92", " (JPEG 2000 part 2)"},
       {"93", " (JPEG 2000 part 2)"},
       {"94", " (JPIP)"},
       {"95", " (JPIP)"},
       {"100", " (MPEG-2)"},
       {"101", " (MPEG-2)"},
       {"201", " (High-Throughput JPEG 2000)"},
       {"202", " (High-Throughput JPEG 2000)"},
       {"203", " (High-Throughput JPEG 2000)"},
       {"55", " (progressive JPEG)"}}};
  if (!uid.starts_with(family)) return "";
  uid.remove_prefix(family.size());
  for (const auto& [number, name] : names)
    if (uid == number) return name;
  if (uid.starts_with("102") || uid.starts_with("103") || uid.starts_with("104") || uid.starts_with("105") ||
      uid.starts_with("106"))
    return " (MPEG-4)";
  return uid.starts_with("107") || uid.starts_with("108") ? " (HEVC)" : "";
}

}  // namespace helicarm::xray
