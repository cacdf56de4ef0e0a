// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/dicom_measurements.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/image/png.h"
#include "helicarm/pipeline/view_image.h"
#include "helicarm/report/earlier_results.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/dicom_tags.h"

namespace helicarm::case_registration {
namespace dicom_measurements_test {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

/// Two located points, one that is not, a tunnel and two images.
struct Knee {
  TemporaryFolder folder;
  pipeline::Case the_case;
  Measurement measured;

  Knee() {
    for (const char* name : {"AP", "LAT"}) {
      the_case.views.emplace_back().name = name;
      write_image(name, "1");
    }
    for (const double x : {0.0, 30.0}) {
      pipeline::PointResult& point = measured.result.points.emplace_back();
      point.name = x == 0 ? "start" : "end";
      point.source = localization::PointSource::pick;
      point.place.emplace().in_calibrator = {x, 0, 5};
      point.place->covariance_in_calibrator = Eigen::Vector3d(0.01, 0.04, 0.09).asDiagonal();
      point.seen = {fiducials::ImagePoint{{10, 20}, {11, 21}, 0.5}, std::nullopt};
    }
    measured.result.points.emplace_back().name = "lost";
    measured.result.points.back().reason = Failure{Reason::not_seen, "one view only", "AP", {}};
    measured.result.tunnels.push_back({"femoral", {}, {}, {}, 30.0});
    measured.result.tunnels.back().length_sigma_mm = 0.5;
    measured.result.tunnel_ends.push_back({0, 1});
    take_images();
  }

  /// The case's images are what was measured.
  void take_images() {
    measured.result.views.clear();
    for (const pipeline::CaseView& view : the_case.views) {
      pipeline::ViewResult& taken = measured.result.views.emplace_back();
      taken.name = view.name;
      const auto image = pipeline::image_of(view);
      EXPECT_TRUE(image) << image.error().message;
      if (image) taken.xray_image = std::make_shared<const xray::XrayImage>(*image);
    }
  }

  void write_image(const std::string& view, const char* patient) {
    xray::DicomBuilder image;
    image.text(0x00080018, "UI", "1.2.3.4." + std::to_string(view.size()));
    image.text(0x0020000D, "UI", "1.2.3").text(0x0020000E, "UI", "1.2.3.4").text(0x00100020, "LO", patient);
    EXPECT_TRUE(write_file(folder.path() / (view + ".dcm"), image.bytes()));
    for (pipeline::CaseView& each : the_case.views)
      if (each.name == view) each.image = folder.path() / (view + ".dcm");
  }

  Expected<DicomResults> written() {
    return write_dicom_results(the_case, measured, folder.path(), folder.path());
  }
};

TEST(DicomMeasurements, AreOfPointsAndTunnels) {
  const Knee knee;
  const auto groups = report_groups(knee.measured, {0, 1});
  ASSERT_THAT(groups, SizeIs(4));
  EXPECT_EQ(groups[0].name, "start");
  ASSERT_THAT(groups[0].values, SizeIs(4));
  EXPECT_EQ(groups[1].values[0].value, 30);
  EXPECT_NEAR(*groups[1].values[1].sigma, 0.2, 1e-12);
  EXPECT_NEAR(*groups[1].values[1].within_95, 1.96 * 0.2, 1e-4);
  EXPECT_NEAR(*groups[0].values[3].value,
              localization::length_at_95(knee.measured.result.points[0].place->covariance_in_calibrator),
              1e-12);
  EXPECT_EQ(groups[3].values[0].value, 30);
  EXPECT_THAT(groups[3].values[0].path, ElementsAre(Eigen::Vector3d(0, 0, 5), Eigen::Vector3d(30, 0, 5)));
}

TEST(DicomMeasurements, ThePickIsMarkedInTheStoredImage) {
  const Knee knee;
  const auto marks = report_groups(knee.measured, {1, std::nullopt})[0].values[3].marks;
  ASSERT_THAT(marks, SizeIs(1));
  EXPECT_EQ(marks[0].image, 1U);
  EXPECT_EQ(marks[0].uv, Eigen::Vector2d(10, 20));
  EXPECT_THAT(report_groups(knee.measured, {std::nullopt, 0})[0].values[3].marks, IsEmpty());
}

TEST(DicomMeasurements, APointThatIsNotLocatedStatesWhy) {
  const Knee knee;
  const xray::ReportValue failed = report_groups(knee.measured, {0, 1})[2].values.at(0);
  EXPECT_FALSE(failed.value);
  EXPECT_THAT(failed.comment, HasSubstr("one view only"));
}

TEST(DicomMeasurements, AreWrittenBesideTheResult) {
  Knee knee;
  const auto results = knee.written();
  ASSERT_TRUE(results) << results.error().message;
  EXPECT_THAT(results->files, ElementsAre(knee.folder.path() / report::dicom_measurements_name));
  EXPECT_THAT(results->left_out, IsEmpty());
  report::forget_results(knee.folder.path());
  EXPECT_FALSE(std::filesystem::exists(results->files.front()));
}

TEST(DicomMeasurements, ImagesOfTwoPatientsAreRefused) {
  Knee knee;
  knee.write_image("LAT", "2");
  knee.take_images();
  EXPECT_EQ(knee.written().error().reason, Reason::patient_mismatch);
}

TEST(DicomMeasurements, ImageOfAnotherPatientThanWasMeasuredIsRefused) {
  Knee knee;
  for (const char* view : {"AP", "LAT"}) knee.write_image(view, "2");
  const auto results = knee.written();
  ASSERT_FALSE(results);
  EXPECT_EQ(results.error().reason, Reason::patient_mismatch);
  EXPECT_EQ(results.error().view, "AP");
  EXPECT_FALSE(std::filesystem::exists(knee.folder.path() / report::dicom_measurements_name));
}

TEST(DicomMeasurements, AnotherImageOfThePatientIsRefused) {
  Knee knee;
  std::swap(knee.the_case.views[0].image, knee.the_case.views[1].image);
  EXPECT_EQ(knee.written().error().reason, Reason::bad_value);
}

TEST(DicomMeasurements, CaseOfOtherViewsIsRefused) {
  Knee knee;
  knee.the_case.views[1].name = "OBL";
  EXPECT_THAT(knee.written().error().message, HasSubstr("AP, OBL"));
  knee.the_case.views.pop_back();
  EXPECT_EQ(knee.written().error().reason, Reason::bad_value);
}

TEST(DicomMeasurements, ImageOfARegistrationAloneIsComparedByItsPixels) {
  Knee knee;
  LoadedViews& loaded = knee.measured.registration.emplace().loaded;
  for (const pipeline::ViewResult& view : knee.measured.result.views) {
    loaded.patient_key = view.xray_image->acquisition.patient_key;
    loaded.views.emplace_back().name = view.name;
    loaded.views.back().grey =
        rectification::resample(*view.xray_image, rectification::flat_panel_map(*view.xray_image));
    loaded.maps.emplace_back();
  }
  knee.measured.result.views.clear();
  EXPECT_TRUE(knee.written());
  loaded.views[1].grey(0, 0) += 1;
  EXPECT_THAT(knee.written().error().message, HasSubstr("pixels"));
  loaded.patient_key = "another";
  EXPECT_EQ(knee.written().error().reason, Reason::patient_mismatch);
}

TEST(DicomMeasurements, ARefusedMeasurementHasNone) {
  Knee knee;
  knee.measured.result.failure = Failure{Reason::uncertain, "", "", {}};
  EXPECT_THAT(knee.written()->files, IsEmpty());
}

TEST(DicomMeasurements, WithoutDicomImagesTheyAreRefused) {
  Knee knee;
  for (pipeline::CaseView& view : knee.the_case.views) {
    view.image = knee.folder.path() / "image.png";
    ASSERT_TRUE(write_file(view.image, image::encode_png(image::Image<std::uint16_t>(8, 6, 100))));
  }
  knee.take_images();
  EXPECT_THAT(knee.written().error().message, HasSubstr("no view's image is a DICOM file"));
}

TEST(DicomMeasurements, OneOfTwoKindsMayBeLeftOut) {
  Knee knee;
  knee.measured.registration.emplace();
  const auto results = knee.written();
  ASSERT_TRUE(results) << results.error().message;
  EXPECT_THAT(results->files, SizeIs(1));
  EXPECT_THAT(results->left_out, ElementsAre(HasSubstr("Frame of Reference UID")));
}

}  // namespace dicom_measurements_test
}  // namespace helicarm::case_registration
