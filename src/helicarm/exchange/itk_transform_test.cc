// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/itk_transform.h"

#include "helicarm/exchange/import_text_test.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::exchange {
namespace {

std::string tfm(const std::string& type, const std::string& parameters, const std::string& fixed) {
  return "#Insight Transform File V1.0\n#Transform 0\nTransform: " + type + "\nParameters: " + parameters +
         "\nFixedParameters: " + fixed + "\n";
}

Expected<std::optional<geometry::RigidTransform>> read_tfm(const std::string& text) {
  return read_itk_transform(WrittenFile(text).path);
}

struct ItkCase {
  std::string type, parameters, fixed;
  Eigen::Vector3d mapped;  ///< of (10, 20, 30), with NumPy from ITK's equations
};

class ItkTypes : public testing::TestWithParam<ItkCase> {};

TEST_P(ItkTypes, MapAPoint) {
  const auto read = read_tfm(tfm(GetParam().type, GetParam().parameters, GetParam().fixed));
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_TRUE(*read);
  EXPECT_LT((**read * Eigen::Vector3d(10, 20, 30) - GetParam().mapped).norm(), 1e-9);
}

INSTANTIATE_TEST_SUITE_P(
    ItkTransform, ItkTypes,
    testing::Values(ItkCase{"Euler3DTransform_double_3_3",
                            "0.2 -0.4 1.1 1.5 -2.5 40",
                            "5 -6 7",
                            {-14.087686753324526, -2.9040206793126018, 74.83580732778242}},
                    ItkCase{"Euler3DTransform_double_3_3",
                            "0.2 -0.4 1.1 1.5 -2.5 40",
                            "5 -6 7 1",
                            {-14.942395046641412, -4.525724102294909, 74.4668677819785}},
                    ItkCase{"VersorRigid3DTransform_double_3_3",
                            "0.1 -0.3 0.25 1.5 -2.5 40",
                            "5 -6 7",
                            {-14.961026991748987, 8.058184452139074, 69.25423213926649}},
                    ItkCase{"QuaternionRigidTransform_double_3_3",
                            "0.1 -0.3 0.25 0.9151502608861564 1.5 -2.5 40",
                            "0 0 0",
                            {-16.874207304812376, 8.584849739113842, 70.65150260886156}},
                    ItkCase{"AffineTransform_double_3_3", "0 -1 0 1 0 0 0 0 1 7 8 9", "1 2 3", {-10, 19, 39}},
                    ItkCase{"TranslationTransform_float_3_3", "7 8 9", "", {17, 28, 39}}));

TEST(ItkTransform, IsReadBackToTheLastBit) {
  const geometry::RigidTransform given{geometry::rotation_from_vector({0.3, -1.2, 0.5}),
                                       {1.0 / 3, -200.7, 6e-5}};
  const auto read = read_tfm(itk_transform_text(given));
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_LT(((*read)->rotation - given.rotation).norm(), 1e-15);
  EXPECT_EQ((*read)->translation, given.translation);
}

TEST(ItkTransform, OtherFilesAreNone) {
  const auto read = read_tfm("1 2 3 4\n");
  ASSERT_TRUE(read);
  EXPECT_FALSE(*read);
  EXPECT_EQ(read_itk_transform("/nonexistent/file").error().reason, Reason::missing_file);
}

TEST(ItkTransform, WhatIsNoRigidTransformIsNamed) {
  const std::string affine = "AffineTransform_double_3_3", identity = "1 0 0 0 1 0 0 0 1 0 0 0";
  for (const auto& [text, reason] :
       {std::pair{tfm(affine, "2 0 0 0 2 0 0 0 2 0 0 0", "0 0 0"), Reason::bad_value},
        {tfm(affine, "1 0 0 0 1 0 0 0 -1 0 0 0", "0 0 0"), Reason::bad_value},
        {tfm(affine, "1 0 0 0 1 0 0 0 1 0 0", "0 0 0"), Reason::bad_size},
        {tfm(affine, identity, "0 0"), Reason::bad_size},
        {tfm(affine, "1 0 0 0 1 0 0 0 1 0 0 nan", "0 0 0"), Reason::not_finite},
        {tfm("VersorRigid3DTransform_double_3_3", "1 1 0 0 0 0", "0 0 0"), Reason::bad_value},
        {tfm("QuaternionRigidTransform_double_3_3", "0 0 0 0 0 0 0", "0 0 0"), Reason::bad_value},
        {tfm("BSplineTransform_double_3_3", identity, "0 0 0"), Reason::unsupported},
        {tfm("AffineTransform_double_2_2", "1 0 0 1 0 0", "0 0"), Reason::unsupported},
        {tfm(affine, identity, "0 0 0") + tfm(affine, identity, "0 0 0"), Reason::unsupported},
        {std::string("#Insight Transform File V1.0\n"), Reason::truncated}}) {
    const auto refused = read_tfm(text);
    ASSERT_FALSE(refused) << text;
    EXPECT_EQ(refused.error().reason, reason) << refused.error().message;
  }
}

}  // namespace
}  // namespace helicarm::exchange
