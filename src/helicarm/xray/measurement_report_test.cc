// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/measurement_report.h"

#include <cstring>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/validated_test.h"

namespace helicarm::xray {
namespace measurement_report_test {

using testing::HasSubstr;
using testing::SizeIs;

const Code millimetre{"mm", "UCUM", "mm"};
constexpr DicomTag content{0x0040A730, "Content Sequence"}, measured{0x0040A300, "Measured Value Sequence"};

DicomBuilder ap_image() {
  DicomBuilder builder;
  return builder.text(0x00100010, "PN", "Doe^Jane")
      .text(0x0020000D, "UI", "1.2.3.5")
      .text(0x0020000E, "UI", "1.2.3.6");
}

class MeasurementReportFile : public testing::Test {
 protected:
  ReportImage image(const DicomBuilder& builder) {
    EXPECT_TRUE(write_file(folder_.path() / "ap.dcm", builder.bytes()));
    return report_image_of(folder_.path() / "ap.dcm", 1)->value();
  }

  MeasurementReport report(const DicomBuilder& builder = ap_image()) {
    ReportValue within{{"error_95", own_scheme, "Error"}, millimetre, 0.25};
    within.path = {{1, 2, 3.5}};
    within.marks = {{0, {4, 2.25}}};
    const ReportValue length{{"410668003", "SCT", "Length"}, millimetre, 31.25, 0.1, 0.196};
    ReportValue failed{{"410668003", "SCT", "Length"}, millimetre, {}};
    failed.comment = "an end is not located";
    return {{image(builder)},
            "1.2.3.7",
            {{"entry", {"point", own_scheme, "Point"}, {within}},
             {"tunnel", {"tunnel", own_scheme, "Tunnel"}, {length, failed}}}};
  }

  DicomElements written(const MeasurementReport& report) {
    const auto done = write_measurement_report(file(), report);
    EXPECT_TRUE(done) << done.error().message;
    bytes_ = *read_file(file(), 1 << 20);
    return *walk_dicom(bytes_, "sr.dcm");
  }

  std::filesystem::path file() const { return folder_.path() / "sr.dcm"; }

  TemporaryFolder folder_;
  std::string bytes_;
};

/// The groups of the report's measurements.
std::vector<DicomElements> groups_of(const DicomElements& root) {
  return sequence_items(sequence_items(root, content).back(), content);
}

TEST_F(MeasurementReportFile, HasThePatientOfTheImageAndNamesIt) {
  const DicomElements root = written(report());
  EXPECT_EQ(root.text(tags::sop_class), "1.2.840.10008.5.1.4.1.1.88.34");
  EXPECT_EQ(root.text(tags::patient_name), "Doe^Jane");
  EXPECT_EQ(root.text(tags::study), "1.2.3.5");
  const auto studies = sequence_items(root, {0x0040A375, "Evidence"});
  ASSERT_THAT(studies, SizeIs(1));
  const auto series = sequence_items(studies[0], {0x00081115, "Series"});
  ASSERT_THAT(series, SizeIs(1));
  EXPECT_EQ(series[0].text(tags::series), "1.2.3.6");
  EXPECT_EQ(sequence_items(series[0], {0x00081199, "SOP"}).at(0).text({0x00081155, ""}), "2.25.17");
}

TEST_F(MeasurementReportFile, HoldsValuesWithTheirErrorsAndUnits) {
  const DicomElements root = written(report());
  const auto groups = groups_of(root);
  ASSERT_THAT(groups, SizeIs(2));
  const auto items = sequence_items(groups[1], content);
  ASSERT_THAT(items, SizeIs(5));  // name, UID, finding and two numbers
  EXPECT_EQ(items[0].text({0x0040A160, "Text"}), "tunnel");
  EXPECT_EQ(sequence_items(items[3], measured).at(0).text({0x0040A30A, ""}), "31.25");
  const auto errors = sequence_items(items[3], content);
  ASSERT_THAT(errors, SizeIs(2));
  EXPECT_EQ(sequence_items(errors[0], measured).at(0).text({0x0040A30A, ""}), "0.1");
  EXPECT_EQ(sequence_items(errors[1], measured).at(0).text({0x0040A30A, ""}), "0.196");
}

TEST_F(MeasurementReportFile, SaysWhereThereIsNoValue) {
  const DicomElements root = written(report());
  const auto failed = sequence_items(groups_of(root)[1], content).at(4);
  EXPECT_THAT(sequence_items(failed, measured), SizeIs(0));
  EXPECT_EQ(sequence_items(failed, {0x0040A301, "Qualifier"}).at(0).text({0x00080100, ""}), "114006");
  EXPECT_EQ(sequence_items(failed, content).at(0).text({0x0040A160, ""}), "an end is not located");
}

TEST_F(MeasurementReportFile, PixelsBeginAtTheCornerOfTheFirst) {
  const DicomElements root = written(report());
  const auto places = sequence_items(sequence_items(groups_of(root)[0], content).at(3), content);
  ASSERT_THAT(places, SizeIs(2));
  const auto floats = [](const DicomElements& item) {
    const DicomElement* data = item.find({0x00700022, "Graphic Data"});
    std::vector<float> numbers(data->value.size() / sizeof(float));
    std::memcpy(numbers.data(), data->value.data(), data->value.size());
    return numbers;
  };
  EXPECT_THAT(floats(places[0]), testing::ElementsAre(1, 2, 3.5));
  EXPECT_EQ(places[0].text({0x30060024, ""}), "1.2.3.7");
  EXPECT_THAT(floats(places[1]), testing::ElementsAre(4.5, 2.75));
}

TEST_F(MeasurementReportFile, ConformsToTheStandard) {
  written(report());
  const auto errors = validated(file());
  if (!errors) GTEST_SKIP() << "dciodvfy (dicom3tools) is not installed";
  EXPECT_EQ(*errors, "");
}

TEST_F(MeasurementReportFile, TheSameContentHasTheSameUid) {
  MeasurementReport one = report();
  const std::string first(written(one).text(tags::sop_instance));
  EXPECT_EQ(written(one).text(tags::sop_instance), first);
  one.groups[1].values[0].value = 31.5;
  EXPECT_NE(written(one).text(tags::sop_instance), first);
}

TEST_F(MeasurementReportFile, APatientsOtherCharacterSetIsKept) {
  MeasurementReport one =
      report(ap_image().text(0x00080005, "CS", "ISO_IR 100").text(0x00100010, "PN", "M\xFCller"));
  one.groups[0].name = "Eingang f\xC3\xBCr";
  const DicomElements root = written(one);
  EXPECT_EQ(root.text({0x00080005, ""}), "ISO_IR 100");
  EXPECT_EQ(root.text(tags::patient_name), "M\xFCller");
  EXPECT_EQ(sequence_items(groups_of(root)[0], content).at(0).text({0x0040A160, ""}), "Eingang f??r");
}

TEST_F(MeasurementReportFile, APatientInAsciiLeavesNamesInUtf8) {
  MeasurementReport one = report(ap_image().text(0x00080005, "CS", "ISO_IR 100"));
  one.groups[0].name = "f\xC3\xBCr";
  const DicomElements root = written(one);
  EXPECT_EQ(root.text({0x00080005, ""}), "ISO_IR 192");
  EXPECT_THAT(bytes_, HasSubstr("f\xC3\xBCr"));
}

TEST_F(MeasurementReportFile, ANumberThatIsNotFiniteIsRefused) {
  MeasurementReport one = report();
  one.groups[1].values[0].sigma = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(write_measurement_report(file(), one).error().message,
              HasSubstr("tunnel: Length is not finite"));
  EXPECT_FALSE(std::filesystem::exists(file()));
}

TEST_F(MeasurementReportFile, WithoutImageOrMeasurementItIsRefused) {
  MeasurementReport one = report();
  one.images.clear();
  EXPECT_THAT(write_measurement_report(file(), one).error().message, HasSubstr("no image"));
  one = report();
  one.groups.clear();
  EXPECT_THAT(write_measurement_report(file(), one).error().message, HasSubstr("no measurement"));
}

TEST_F(MeasurementReportFile, AnImageWithoutSeriesCannotBeNamed) {
  ASSERT_TRUE(write_file(folder_.path() / "ap.dcm", ap_image().erase(0x0020000E).bytes()));
  EXPECT_FALSE(*report_image_of(folder_.path() / "ap.dcm", 1));
  ASSERT_TRUE(write_file(folder_.path() / "ap.png", "\x89PNG"));
  EXPECT_FALSE(*report_image_of(folder_.path() / "ap.png", {}));
}

}  // namespace measurement_report_test
}  // namespace helicarm::xray
