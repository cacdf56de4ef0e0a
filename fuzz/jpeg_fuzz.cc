// SPDX-License-Identifier: Apache-2.0
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dcostrmb.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpeg/djrplol.h>
#include <dcmtk/dcmjpeg/djrploss.h>
#include <dcmtk/oflog/oflog.h>

#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/dicom_elements.h"
#include "helicarm/xray/jpeg.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

constexpr int width = 24, height = 16;

/// The image compressed by DCMTK's encoder.
std::string compressed(int bits, E_TransferSyntax syntax, const DcmRepresentationParameter& how) {
  std::string pixels;
  for (int i = 0; i < width * height; ++i)
    pixels += xray::DicomBuilder::number(i * 37 % (1 << bits), bits > 8 ? 2 : 1);
  xray::DicomBuilder builder;
  builder.word(0x00280010, height).word(0x00280011, width).word(0x00280100, bits > 8 ? 16 : 8);
  builder.word(0x00280101, bits).word(0x00280102, bits - 1).raw(0x7FE00010, bits > 8 ? "OW" : "OB", pixels);
  const std::string plain = builder.bytes();
  DcmInputBufferStream in;
  in.setBuffer(plain.data(), static_cast<offile_off_t>(plain.size()));
  in.setEos();
  DcmFileFormat file;
  if (file.read(in).bad()) return {};
  file.loadAllDataIntoMemory();
  if (file.getDataset()->chooseRepresentation(syntax, &how).bad()) return {};
  std::string out(1 << 20, '\0');
  DcmOutputBufferStream stream(out.data(), static_cast<offile_off_t>(out.size()));
  file.transferInit();
  file.write(stream, syntax, EET_ExplicitLength, nullptr);
  file.transferEnd();
  void* written = nullptr;
  offile_off_t size = 0;
  stream.flushBuffer(written, size);
  out.resize(static_cast<std::size_t>(size));
  const auto elements = xray::walk_dicom(out, "seed");
  return elements && elements->fragments.size() > 1 ? std::string(elements->fragments[1]) : std::string{};
}

}  // namespace

void run(std::string_view bytes) {
  Choices choices(bytes);
  const unsigned mode = choices.byte();
  const bool lossless = mode & 1, own_size = mode & 4;
  const int word_bytes = mode & 2 ? 2 : 1;
  const int wide = own_size ? 1 + static_cast<int>(choices.byte() % 64) : width;
  const int high = own_size ? 1 + static_cast<int>(choices.byte() % 64) : height;
  const auto decoded = xray::decode_jpeg(std::string(bytes), lossless, wide, high, word_bytes, "input");
  if (decoded)
    check(decoded->size() == std::size_t(wide * high * word_bytes), "the byte count matches the pixels");
}

std::vector<std::string> seeds() {
  OFLog::configure(OFLogger::OFF_LOG_LEVEL);
  DJEncoderRegistration::registerCodecs(ECC_lossyYCbCr, EUC_default, OFFalse, 0, 0, 0, OFTrue, ESS_444,
                                        OFFalse, OFFalse, 0, 0, 0, 0, 0, 0, 0, 0, OFFalse);
  const DJ_RPLossless first_order(1, 0), fourth(4, 0);
  const DJ_RPLossy quality(90);
  std::vector<std::string> all;
  for (const int bits : {8, 12, 16}) {
    const char mode = bits > 8 ? 3 : 1;
    all.push_back(mode + compressed(bits, EXS_JPEGProcess14SV1, first_order));
    all.push_back(mode + compressed(bits, EXS_JPEGProcess14, fourth));
  }
  all.push_back('\0' + compressed(8, EXS_JPEGProcess1, quality));
  all.push_back('\2' + compressed(12, EXS_JPEGProcess2_4, quality));
  DJEncoderRegistration::cleanup();
  return all;
}

}  // namespace helicarm::fuzz
