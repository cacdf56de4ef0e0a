// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/igtl_image.h"

#include <limits>
#include <stdexcept>

#include <Eigen/Geometry>

#include "helicarm/core/big_endian.h"

namespace helicarm::tracker {
namespace {

// Numbers of the format's tables.
constexpr std::uint8_t one_component = 1, scalars_uint16 = 5, big_endian = 1, coordinates_ras = 1;

void put_vector(BigEndianWriter& out, const Eigen::Vector3d& vector) {
  for (const double value : vector) out.put(static_cast<float>(value));
}

void put_size(BigEndianWriter& out, const PlacedImage& image) {
  out.put(static_cast<std::uint16_t>(image.width)).put(static_cast<std::uint16_t>(image.height));
  out.put(std::uint16_t{1});
}

void check_placed(const PlacedImage& image) {
  constexpr int most = std::numeric_limits<std::uint16_t>::max();
  if (image.width < 1 || image.height < 1 || image.width > most || image.height > most ||
      image.pixels.size() != std::size_t(image.width) * std::size_t(image.height))
    throw std::invalid_argument("image of no size that OpenIGTLink has");
}

}  // namespace

IgtlMessage image_message(const std::string& device, const PlacedImage& image) {
  check_placed(image);
  BigEndianWriter out;
  out.put(std::uint16_t{1}).put(one_component).put(scalars_uint16).put(big_endian).put(coordinates_ras);
  put_size(out, image);
  put_vector(out, image.column_step);
  put_vector(out, image.row_step);
  put_vector(out, image.column_step.cross(image.row_step).normalized());
  put_vector(out, image.middle);
  for (int i = 0; i < 3; ++i) out.put(std::uint16_t{0});  // offset of the part that is sent: all
  put_size(out, image);
  std::string content = std::move(out).bytes();
  content.reserve(content.size() + 2 * image.pixels.size());
  for (const std::uint16_t value : image.pixels) {
    content += static_cast<char>(value >> 8);
    content += static_cast<char>(value & 0xFF);
  }
  return {device, 0, IgtlUnknown{"IMAGE", std::move(content)}};
}

}  // namespace helicarm::tracker
