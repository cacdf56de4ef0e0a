// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <string_view>

namespace helicarm::xray {

/// How Pixel Data are stored.
enum class Coding { native, rle, jpeg, jpeg_lossless, jpeg_ls, jpeg_2000 };

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

}  // namespace helicarm::xray
