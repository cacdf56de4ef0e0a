// SPDX-License-Identifier: Apache-2.0
// Compressed transfer syntaxes, encoded by DCMTK, and their damage.
#include <chrono>
#include <cmath>
#include <memory>

#include <charls/charls.h>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dcostrmb.h>
#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpeg/djrplol.h>
#include <dcmtk/dcmjpeg/djrploss.h>
#include <dcmtk/oflog/oflog.h>
#include <gtest/gtest.h>
#include <openjpeg.h>
#include <zlib.h>

#include "helicarm/core/random.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/plain_bytes.h"
#include "helicarm/xray/read_dicom.h"

namespace helicarm::xray {
namespace {

constexpr int width = 40, height = 30;

class Compressed : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    OFLog::configure(OFLogger::OFF_LOG_LEVEL);
    // DCMTK rescales the grey values before lossy compression by default: switched off.
    DJEncoderRegistration::registerCodecs(ECC_lossyYCbCr, EUC_default, OFFalse, 0, 0, 0, OFTrue, ESS_444,
                                          OFFalse, OFFalse, 0, 0, 0, 0, 0, 0, 0, 0, OFFalse);
    DcmRLEEncoderRegistration::registerCodecs();
  }
  static void TearDownTestSuite() {
    DJEncoderRegistration::cleanup();
    DcmRLEEncoderRegistration::cleanup();
  }
};

/// Smooth image of `bits` bits.
DicomBuilder grey_image(int bits, int frames = 1) {
  std::string bytes;
  for (int f = 0; f < frames; ++f)
    for (int v = 0; v < height; ++v)
      for (int u = 0; u < width; ++u) {
        const double value = 0.5 + 0.4 * std::sin(0.2 * u + f) * std::cos(0.1 * v);
        bytes += DicomBuilder::number(static_cast<int>(value * ((1 << bits) - 1)), bits > 8 ? 2 : 1);
      }
  return DicomBuilder()
      .text(0x00280008, "IS", std::to_string(frames))
      .word(0x00280010, height)
      .word(0x00280011, width)
      .word(0x00280100, bits > 8 ? 16 : 8)
      .word(0x00280101, bits)
      .word(0x00280102, bits - 1)
      .raw(0x7FE00010, bits > 8 ? "OW" : "OB", bytes);
}

std::string compress(const std::string& bytes, E_TransferSyntax syntax,
                     const DcmRepresentationParameter* how) {
  DcmInputBufferStream in;
  in.setBuffer(bytes.data(), static_cast<offile_off_t>(bytes.size()));
  in.setEos();
  DcmFileFormat file;
  EXPECT_TRUE(file.read(in).good());
  file.loadAllDataIntoMemory();
  EXPECT_TRUE(file.getDataset()->chooseRepresentation(syntax, how).good());
  std::string out(1 << 20, '\0');
  DcmOutputBufferStream stream(out.data(), static_cast<offile_off_t>(out.size()));
  file.transferInit();
  EXPECT_TRUE(file.write(stream, syntax, EET_ExplicitLength, nullptr).good());
  file.transferEnd();
  stream.flush();
  void* written = nullptr;
  offile_off_t size = 0;
  stream.flushBuffer(written, size);
  out.resize(static_cast<std::size_t>(size));
  return out;
}

/// Stored words of the builder's image, 16 bits allocated.
std::vector<std::uint16_t> words_of(const DicomBuilder& builder) {
  const auto xray_image = read_dicom(builder.bytes(), "x.dcm", {});
  std::vector<std::uint16_t> words;
  for (const float value : xray_image->pixels.pixels()) words.push_back(static_cast<std::uint16_t>(value));
  return words;
}

std::string jpeg_ls(const DicomBuilder& builder, int bits, int near) {
  std::vector<std::uint16_t> words = words_of(builder);
  std::string bytes;
  for (const std::uint16_t word : words) bytes += DicomBuilder::number(word, bits > 8 ? 2 : 1);
  charls::jpegls_encoder encoder;
  encoder.frame_info({width, height, bits, 1}).near_lossless(near);
  std::string out(encoder.estimated_destination_size(), '\0');
  encoder.destination(out.data(), out.size());
  out.resize(encoder.encode(bytes.data(), bytes.size()));
  return out;
}

/// Collects what OpenJPEG writes.
struct Sink {
  std::string bytes = {};
  std::size_t at = 0;
};

OPJ_BOOL go_to(OPJ_OFF_T at, void* to) {
  auto& sink = *static_cast<Sink*>(to);
  sink.at = std::size_t(at);
  if (sink.bytes.size() < sink.at) sink.bytes.resize(sink.at);
  return OPJ_TRUE;
}

OPJ_OFF_T go_on(OPJ_OFF_T size, void* to) {
  go_to(OPJ_OFF_T(static_cast<Sink*>(to)->at) + size, to);
  return size;
}

OPJ_SIZE_T put(void* from, OPJ_SIZE_T size, void* to) {
  auto& sink = *static_cast<Sink*>(to);
  sink.bytes.replace(sink.at, size, static_cast<const char*>(from), size);
  sink.at += size;
  return size;
}

std::string jpeg_2000(const DicomBuilder& builder, int bits, OPJ_CODEC_FORMAT format = OPJ_CODEC_J2K) {
  opj_image_cmptparm_t component{};
  component.dx = component.dy = 1;
  component.w = width;
  component.h = height;
  component.prec = OPJ_UINT32(bits);
  opj_image_t* image = opj_image_create(1, &component, OPJ_CLRSPC_GRAY);
  image->x1 = width;
  image->y1 = height;
  std::ranges::copy(words_of(builder), image->comps[0].data);
  opj_cparameters_t parameters;
  opj_set_default_encoder_parameters(&parameters);
  parameters.tcp_numlayers = 1;
  parameters.tcp_rates[0] = 0;
  parameters.cp_disto_alloc = 1;
  parameters.numresolution = 3;
  opj_codec_t* codec = opj_create_compress(format);
  opj_setup_encoder(codec, &parameters, image);
  Sink sink;
  opj_stream_t* stream = opj_stream_default_create(OPJ_FALSE);
  opj_stream_set_user_data(stream, &sink, nullptr);
  opj_stream_set_write_function(stream, put);
  opj_stream_set_skip_function(stream, go_on);
  opj_stream_set_seek_function(stream, go_to);
  EXPECT_TRUE(opj_start_compress(codec, image, stream) && opj_encode(codec, stream) &&
              opj_end_compress(codec, stream));
  opj_stream_destroy(stream);
  opj_destroy_codec(codec);
  opj_image_destroy(image);
  return sink.bytes;
}

std::string encapsulated(DicomBuilder builder, const char* syntax, const std::string& stream) {
  return builder.syntax(syntax).fragments({stream}).bytes();
}

float greatest_difference(const XrayImage& a, const XrayImage& b) {
  float difference = 0;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      difference = std::max(difference, std::abs(a.pixels(u, v) - b.pixels(u, v)));
  return difference;
}

void expect_close(int bits, E_TransferSyntax syntax, const DcmRepresentationParameter* how, float tolerance) {
  const std::string plain = grey_image(bits).bytes();
  const auto compressed = read_dicom(compress(plain, syntax, how), "x.dcm", {});
  ASSERT_TRUE(compressed) << bits << ": " << compressed.error().message;
  EXPECT_LE(greatest_difference(*compressed, *read_dicom(plain, "x.dcm", {})), tolerance) << bits;
}

TEST_F(Compressed, RleIsExact) {
  for (int bits : {8, 12, 16}) expect_close(bits, EXS_RLELossless, nullptr, 0);
}

TEST_F(Compressed, LosslessJpegIsExact) {
  const DJ_RPLossless first_order(1, 0), fourth(4, 0);
  for (int bits : {8, 10, 12, 16}) {
    expect_close(bits, EXS_JPEGProcess14SV1, &first_order, 0);
    expect_close(bits, EXS_JPEGProcess14, &fourth, 0);
  }
}

TEST_F(Compressed, LossyJpegIsClose) {
  const DJ_RPLossy quality(95);
  expect_close(8, EXS_JPEGProcess1, &quality, 4);
  expect_close(12, EXS_JPEGProcess2_4, &quality, 64);
}

TEST_F(Compressed, InvalidScanHeaderOfASequentialJpegIsCorrected) {
  const DJ_RPLossy quality(95);
  const std::string sound = compress(grey_image(8).bytes(), EXS_JPEGProcess1, &quality);
  std::string odd = sound;
  const std::size_t scan = odd.find("\xFF\xDA");
  ASSERT_NE(scan, std::string::npos);
  odd[scan + 8] = 0;
  const auto xray_image = read_dicom(odd, "x.dcm", {});
  ASSERT_TRUE(xray_image) << xray_image.error().message;
  EXPECT_EQ(greatest_difference(*xray_image, *read_dicom(sound, "x.dcm", {})), 0);
  ASSERT_FALSE(xray_image->warnings.empty());
  EXPECT_EQ(xray_image->warnings[0].reason, Reason::lossy_image);
}

TEST_F(Compressed, BytesBehindTheEndOfImageAreIgnored) {
  const DJ_RPLossy quality(95);
  const DicomBuilder plain = grey_image(8);
  const std::string sound = compress(plain.bytes(), EXS_JPEGProcess1, &quality);
  const std::size_t begin = sound.find("\xFF\xD8"), end = sound.rfind("\xFF\xD9") + 2;
  for (const std::string& behind :
       {std::string("\0\0\1\2", 4), std::string("\xD3\x0C\x99\xFA"), std::string("\xFF\xFF\xFF")}) {
    const std::string jpeg = sound.substr(begin, end - begin) + behind;
    const auto read = read_dicom(encapsulated(plain, "1.2.840.10008.1.2.4.50", jpeg), "x.dcm", {});
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(greatest_difference(*read, *read_dicom(sound, "x.dcm", {})), 0);
  }
  const std::string cut = sound.substr(begin, end - begin - 2) + "\x01\x02";
  EXPECT_EQ(read_dicom(encapsulated(plain, "1.2.840.10008.1.2.4.50", cut), "x.dcm", {}).error().reason,
            Reason::truncated);
}

TEST_F(Compressed, Jpeg2000InBoxesIsRead) {
  const DicomBuilder plain = grey_image(12);
  const auto decoded = read_dicom(
      encapsulated(plain, "1.2.840.10008.1.2.4.90", jpeg_2000(plain, 12, OPJ_CODEC_JP2)), "x.dcm", {});
  ASSERT_TRUE(decoded) << decoded.error().message;
  EXPECT_EQ(greatest_difference(*decoded, *read_dicom(plain.bytes(), "x.dcm", {})), 0);
}

TEST_F(Compressed, LosslessJpegLsIsExact) {
  for (int bits : {8, 10, 12, 16}) {
    const DicomBuilder plain = grey_image(bits);
    const auto decoded =
        read_dicom(encapsulated(plain, "1.2.840.10008.1.2.4.80", jpeg_ls(plain, bits, 0)), "x.dcm", {});
    ASSERT_TRUE(decoded) << bits << ": " << decoded.error().message;
    EXPECT_EQ(greatest_difference(*decoded, *read_dicom(plain.bytes(), "x.dcm", {})), 0) << bits;
  }
}

TEST_F(Compressed, NearLosslessJpegLsIsCloseWithAWarning) {
  const DicomBuilder plain = grey_image(12);
  const auto decoded =
      read_dicom(encapsulated(plain, "1.2.840.10008.1.2.4.81", jpeg_ls(plain, 12, 3)), "x.dcm", {});
  ASSERT_TRUE(decoded) << decoded.error().message;
  EXPECT_LE(greatest_difference(*decoded, *read_dicom(plain.bytes(), "x.dcm", {})), 3);
  ASSERT_FALSE(decoded->warnings.empty());
  EXPECT_EQ(decoded->warnings[0].reason, Reason::lossy_image);
}

TEST_F(Compressed, LosslessJpeg2000IsExact) {
  for (int bits : {8, 10, 12, 16}) {
    const DicomBuilder plain = grey_image(bits);
    const auto decoded =
        read_dicom(encapsulated(plain, "1.2.840.10008.1.2.4.90", jpeg_2000(plain, bits)), "x.dcm", {});
    ASSERT_TRUE(decoded) << bits << ": " << decoded.error().message;
    EXPECT_EQ(greatest_difference(*decoded, *read_dicom(plain.bytes(), "x.dcm", {})), 0) << bits;
  }
}

TEST_F(Compressed, DeflatedAndBigEndianFilesAreExact) {
  for (int bits : {8, 12, 16}) {
    expect_close(bits, EXS_DeflatedLittleEndianExplicit, nullptr, 0);
    expect_close(bits, EXS_BigEndianExplicit, nullptr, 0);
  }
}

TEST_F(Compressed, TruncatedOrTooLargeDeflatedDataAreRefused) {
  const std::string file = compress(grey_image(12).bytes(), EXS_DeflatedLittleEndianExplicit, nullptr);
  EXPECT_EQ(read_dicom(file.substr(0, file.size() - 40), "x.dcm", {}).error().reason, Reason::truncated);
  const std::string large(1 << 20, '\0');
  std::string deflated(1 << 16, '\0');
  z_stream stream{};
  ASSERT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(large.data()));
  stream.avail_in = uInt(large.size());
  stream.next_out = reinterpret_cast<Bytef*>(deflated.data());
  stream.avail_out = uInt(deflated.size());
  ASSERT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  deflateEnd(&stream);
  EXPECT_EQ(inflated(deflated, "x.dcm")->size(), large.size());
  EXPECT_EQ(inflated(deflated, "x.dcm", 1000).error().reason, Reason::bad_value);
}

TEST_F(Compressed, CodestreamOfAnotherSizeIsRefused) {
  const DicomBuilder plain = grey_image(12);
  DicomBuilder other(plain);
  other.word(0x00280010, height + 2);
  for (const auto& [syntax, stream] : {std::pair{"1.2.840.10008.1.2.4.80", jpeg_ls(plain, 12, 0)},
                                       {"1.2.840.10008.1.2.4.90", jpeg_2000(plain, 12)}}) {
    const auto refused = read_dicom(encapsulated(other, syntax, stream), "x.dcm", {});
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().reason, Reason::bad_value);
    EXPECT_FALSE(read_dicom(encapsulated(plain, syntax, stream.substr(0, stream.size() / 2)), "x.dcm", {}));
  }
}

TEST_F(Compressed, FramesAreFoundByCountAndByOffsetTable) {
  const std::string plain = grey_image(12, 3).bytes();
  const std::string rle = compress(plain, EXS_RLELossless, nullptr);
  const DJ_RPLossless first_order(1, 0);
  const std::string jpeg = compress(plain, EXS_JPEGProcess14SV1, &first_order);
  for (int frame = 1; frame <= 3; ++frame) {
    const auto expected = read_dicom(plain, "x.dcm", frame);
    for (const std::string* file : {&rle, &jpeg}) {
      const auto xray_image = read_dicom(*file, "x.dcm", frame);
      ASSERT_TRUE(xray_image) << xray_image.error().message;
      EXPECT_EQ(xray_image->acquisition.instance_key, expected->acquisition.instance_key);
    }
  }
}

TEST_F(Compressed, FrameSplitOverFragments) {
  // One segment: 24 literal pixels, then a run of 24; two such frames in four fragments.
  const auto segment = [](char value) {
    return std::string(1, 23) + std::string(24, value) + '\xE9' + value;
  };
  const auto frame = [&](char value) {
    return DicomBuilder::number(1, 4) + DicomBuilder::number(64, 4) + std::string(56, '\0') + segment(value);
  };
  const std::string one = frame('a'), two = frame('b') + '\0';
  const std::string padded = one + '\0';
  const std::vector<std::string> pieces = {padded.substr(0, 70), padded.substr(70), two.substr(0, 66),
                                           two.substr(66)};
  const int second = static_cast<int>(8 + pieces[0].size() + 8 + pieces[1].size());
  auto builder = DicomBuilder()
                     .syntax("1.2.840.10008.1.2.5")
                     .text(0x00280008, "IS", "2")
                     .word(0x00280100, 8)
                     .word(0x00280101, 8)
                     .word(0x00280102, 7);
  const auto with_table = DicomBuilder(builder)
                              .fragments(pieces, DicomBuilder::number(0, 4) + DicomBuilder::number(second, 4))
                              .bytes();
  ASSERT_TRUE(read_dicom(with_table, "x.dcm", 2)) << read_dicom(with_table, "x.dcm", 2).error().message;
  EXPECT_EQ(read_dicom(with_table, "x.dcm", 1)->pixels(7, 5), 'a');
  EXPECT_EQ(read_dicom(with_table, "x.dcm", 2)->pixels(0, 0), 'b');
  // Without a table the images' headers tell.
  EXPECT_EQ(read_dicom(builder.fragments(pieces).bytes(), "x.dcm", 2)->pixels(0, 0), 'b');
  const std::vector<std::string> headless = {pieces[1], pieces[0], pieces[3]};
  EXPECT_EQ(read_dicom(builder.fragments(headless).bytes(), "x.dcm", 1).error().reason, Reason::bad_value);
}

TEST_F(Compressed, DamageIsRefusedQuickly) {
  const auto start = std::chrono::steady_clock::now();
  const auto jpeg = [](const std::string& stream) {
    return read_dicom(DicomBuilder().syntax("1.2.840.10008.1.2.4.70").fragments({stream}).bytes(), "x.dcm",
                      {});
  };
  const std::string head = "\xFF\xD8";
  const std::string frame_header = std::string("\xFF\xC3\x00\x0B\x0C\x00\x06\x00\x08\x01\x01\x11\x00", 13);
  const std::string other_size = std::string("\xFF\xC3\x00\x0B\x0C\xFF\xFF\xFF\xFF\x01\x01\x11\x00", 13);
  std::string temporary_markers = head;
  for (int i = 0; i < 10000; ++i) temporary_markers += "\xFF\x01";
  for (const std::string& stream :
       {std::string("raw pixels"), head, head + frame_header, head + frame_header + "\xFF\xD9",
        head + other_size + "\xFF\xD9", temporary_markers + "\xFF\xD9", head + std::string(1000, '\xFF')}) {
    const auto xray_image = jpeg(stream);
    ASSERT_FALSE(xray_image);
    EXPECT_TRUE(xray_image.error().reason == Reason::bad_value ||
                xray_image.error().reason == Reason::truncated);
  }
  const auto rle = [](const std::string& frame) {
    return read_dicom(DicomBuilder().syntax("1.2.840.10008.1.2.5").fragments({frame}).bytes(), "x.dcm", {});
  };
  EXPECT_FALSE(rle(std::string(10, 'x')));
  EXPECT_FALSE(rle(DicomBuilder::number(2, 4) + DicomBuilder::number(64, 4) +
                   DicomBuilder::number(0x7FFFFFFF, 4) + std::string(100, '\0')));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(2));
}

TEST_F(Compressed, MutationsNeverCrash) {
  const DJ_RPLossless first_order(1, 0);
  const DJ_RPLossy quality(90);
  const std::vector<std::string> files = {
      grey_image(12).bytes(),
      compress(grey_image(12).bytes(), EXS_RLELossless, nullptr),
      compress(grey_image(12).bytes(), EXS_JPEGProcess14SV1, &first_order),
      compress(grey_image(8).bytes(), EXS_JPEGProcess1, &quality),
      compress(grey_image(12).bytes(), EXS_DeflatedLittleEndianExplicit, nullptr),
      compress(grey_image(12).bytes(), EXS_BigEndianExplicit, nullptr),
      encapsulated(grey_image(12), "1.2.840.10008.1.2.4.80", jpeg_ls(grey_image(12), 12, 0)),
      encapsulated(grey_image(12), "1.2.840.10008.1.2.4.90", jpeg_2000(grey_image(12), 12))};
  RandomStream random(11, 1);
  for (const std::string& file : files)
    for (int trial = 0; trial < 1500; ++trial) {
      std::string bytes = file;
      const auto size = static_cast<std::uint32_t>(bytes.size());
      for (std::uint32_t flips = 1 + random.index(3); flips > 0; --flips)
        bytes[132 + random.index(size - 132)] = static_cast<char>(random.bits());
      if (random.index(4) == 0) bytes.resize(random.index(size));
      const auto xray_image = read_dicom(bytes, "x.dcm", {});
      if (xray_image) {
        EXPECT_FALSE(xray_image->pixels.empty());
      } else {
        EXPECT_EQ(exit_code(xray_image.error().reason), 2);
      }
    }
}

}  // namespace
}  // namespace helicarm::xray
