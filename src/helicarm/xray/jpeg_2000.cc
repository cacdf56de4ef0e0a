// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/jpeg_2000.h"

#include <algorithm>
#include <cstring>
#include <memory>

#include <fmt/format.h>
#include <openjpeg.h>

namespace helicarm::xray {
namespace {

struct Source {
  std::string_view bytes;
  std::size_t at = 0;
};

constexpr auto end_of_stream = static_cast<OPJ_SIZE_T>(-1);

OPJ_SIZE_T read(void* to, OPJ_SIZE_T size, void* from) {
  auto& source = *static_cast<Source*>(from);
  const std::size_t count = std::min<std::size_t>(size, source.bytes.size() - source.at);
  std::memcpy(to, source.bytes.data() + source.at, count);
  source.at += count;
  return count == 0 ? end_of_stream : count;
}

OPJ_OFF_T skip(OPJ_OFF_T size, void* from) {
  auto& source = *static_cast<Source*>(from);
  if (size < 0 || source.at == source.bytes.size()) return -1;
  const std::size_t count = std::min(std::size_t(size), source.bytes.size() - source.at);
  source.at += count;
  return OPJ_OFF_T(count);
}

OPJ_BOOL seek(OPJ_OFF_T to, void* from) {
  auto& source = *static_cast<Source*>(from);
  if (to < 0 || std::size_t(to) > source.bytes.size()) return OPJ_FALSE;
  source.at = std::size_t(to);
  return OPJ_TRUE;
}

template <auto Close>
struct Closer {
  template <class Object>
  void operator()(Object* object) const {
    Close(object);
  }
};
using Stream = std::unique_ptr<opj_stream_t, Closer<opj_stream_destroy>>;

Stream stream_of(Source& source) {
  Stream stream(opj_stream_default_create(OPJ_TRUE));
  if (!stream) throw std::bad_alloc();
  opj_stream_set_user_data(stream.get(), &source, nullptr);
  opj_stream_set_user_data_length(stream.get(), source.bytes.size());
  opj_stream_set_read_function(stream.get(), read);
  opj_stream_set_skip_function(stream.get(), skip);
  opj_stream_set_seek_function(stream.get(), seek);
  return stream;
}

}  // namespace

Expected<std::string> decode_jpeg_2000(std::string_view codestream, int width, int height, int word_bytes,
                                       const std::string& origin) {
  const auto damaged = [&](std::string_view why) {
    return fail(Reason::bad_value, fmt::format("{}: JPEG 2000 data: {}", origin, why));
  };
  Source source{codestream};
  const Stream stream = stream_of(source);
  const bool in_boxes = codestream.starts_with(std::string_view("\0\0\0\x0CjP  ", 8));
  const std::unique_ptr<opj_codec_t, Closer<opj_destroy_codec>> codec(
      opj_create_decompress(in_boxes ? OPJ_CODEC_JP2 : OPJ_CODEC_J2K));
  opj_dparameters_t parameters;
  opj_set_default_decoder_parameters(&parameters);
  opj_image_t* opened = nullptr;
  const bool has_header = codec && opj_setup_decoder(codec.get(), &parameters) &&
                          opj_decoder_set_strict_mode(codec.get(), OPJ_TRUE) &&
                          opj_read_header(stream.get(), codec.get(), &opened);
  const std::unique_ptr<opj_image_t, Closer<opj_image_destroy>> image(opened);
  if (!has_header || !image) return damaged("no valid header");
  const auto size = [](OPJ_UINT32 from, OPJ_UINT32 to) { return std::int64_t(to) - std::int64_t(from); };
  if (image->numcomps != 1 || size(image->x0, image->x1) != width || size(image->y0, image->y1) != height)
    return damaged(fmt::format("{} x {} pixels of {} component(s), must be {} x {} of 1",
                               size(image->x0, image->x1), size(image->y0, image->y1), image->numcomps, width,
                               height));
  const opj_image_comp_t& grey = image->comps[0];
  if (grey.dx != 1 || grey.dy != 1 || grey.prec > unsigned(8 * word_bytes))
    return damaged(fmt::format("{} bits a pixel, {} allocated", grey.prec, 8 * word_bytes));
  if (!opj_decode(codec.get(), stream.get(), image.get()) || !opj_end_decompress(codec.get(), stream.get()) ||
      !grey.data || grey.w != unsigned(width) || grey.h != unsigned(height))
    return damaged("damaged or incomplete");

  const std::size_t pixels = std::size_t(width) * std::size_t(height), bytes = std::size_t(word_bytes);
  std::string out(pixels * bytes, '\0');
  for (std::size_t i = 0; i < pixels; ++i) {
    const auto value = static_cast<std::uint16_t>(grey.data[i]);
    std::memcpy(out.data() + bytes * i, &value, bytes);
  }
  return out;
}

}  // namespace helicarm::xray
