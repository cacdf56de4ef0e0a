// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/belong_together.h"

#include <gtest/gtest.h>

namespace helicarm::pipeline {
namespace {

xray::XrayImage image_of_patient(const char* name, const char* patient, const char* pixels) {
  xray::XrayImage image;
  image.name = name;
  image.pixels = image::Image<float>(64, 64);
  for (int v = 0; v < 64; ++v)
    for (int u = 0; u < 64; ++u) image.pixels(u, v) = static_cast<float>(200 + 20 * u + 10 * v);
  image.acquisition.patient_key = patient;
  image.acquisition.instance_key = pixels;
  return image;
}

Expected<void> checked(const xray::XrayImage& a, const xray::XrayImage& b) {
  return check_images_belong_together({&a, &b});
}

TEST(ImagesBelongTogether, TwoPatientsAreRefused) {
  const auto images = checked(image_of_patient("AP", "p", "1"), image_of_patient("LAT", "q", "2"));
  ASSERT_FALSE(images);
  EXPECT_EQ(images.error().reason, Reason::patient_mismatch);
  EXPECT_NE(images.error().message.find("AP and LAT"), std::string::npos);
}

TEST(ImagesBelongTogether, AnUnnamedPatientMayBeAnyone) {
  EXPECT_TRUE(checked(image_of_patient("AP", "p", "1"), image_of_patient("LAT", "", "2")));
  EXPECT_TRUE(checked(image_of_patient("AP", "", ""), image_of_patient("LAT", "", "")));
}

TEST(ImagesBelongTogether, OneImageAsTwoViewsIsRefused) {
  EXPECT_EQ(checked(image_of_patient("AP", "p", "1"), image_of_patient("LAT", "p", "1")).error().reason,
            Reason::views_too_close);
}

}  // namespace
}  // namespace helicarm::pipeline
