// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/plain_bytes.h"

#include <algorithm>
#include <array>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dcostrmb.h>
#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>
#include <zlib.h>

namespace helicarm::xray {

Expected<std::string> inflated(std::string_view deflated, const std::string& origin, std::size_t most_bytes) {
  z_stream stream{};
  if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) throw std::bad_alloc();
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(deflated.data()));
  stream.avail_in = static_cast<uInt>(deflated.size());
  std::string out;
  std::array<char, 1 << 16> block;
  int status = Z_OK;
  while (status == Z_OK && out.size() <= most_bytes) {
    stream.next_out = reinterpret_cast<Bytef*>(block.data());
    stream.avail_out = static_cast<uInt>(block.size());
    status = inflate(&stream, Z_NO_FLUSH);
    out.append(block.data(), block.size() - stream.avail_out);
  }
  inflateEnd(&stream);
  if (out.size() > most_bytes)
    return fail(Reason::bad_value, fmt::format("{}: the deflated data set is larger than {} MiB", origin,
                                               max_inflated_bytes >> 20));
  if (status == Z_BUF_ERROR)
    return fail(Reason::truncated, fmt::format("{}: the deflated data set is truncated", origin));
  if (status != Z_STREAM_END)
    return fail(Reason::bad_value, fmt::format("{}: the deflated data set is damaged", origin));
  return out;
}

Expected<std::string> as_little_endian(std::string_view file, const std::string& origin) {
  const auto refused = [&](const OFCondition& status) {
    return fail(Reason::bad_value, fmt::format("{}: big-endian data set: {}", origin, status.text()));
  };
  DcmInputBufferStream in;
  in.setBuffer(file.data(), static_cast<offile_off_t>(file.size()));
  in.setEos();
  DcmFileFormat dicom;
  dicom.transferInit();
  if (const OFCondition status = dicom.read(in); status.bad()) return refused(status);
  dicom.transferEnd();
  dicom.loadAllDataIntoMemory();
  constexpr std::size_t room_for_headers = 1 << 16;
  std::string out(file.size() + room_for_headers, '\0');
  DcmOutputBufferStream stream(out.data(), static_cast<offile_off_t>(out.size()));
  dicom.transferInit();
  const OFCondition status =
      dicom.write(stream, EXS_LittleEndianExplicit, EET_UndefinedLength, nullptr, EGL_withoutGL);
  dicom.transferEnd();
  if (status.bad()) return refused(status);
  void* written = nullptr;
  offile_off_t size = 0;
  stream.flushBuffer(written, size);
  out.resize(std::size_t(size));
  return out;
}

}  // namespace helicarm::xray
