// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/write_dicom.h"

#include <cmath>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/xray/derived_image.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/dicom_text.h"
#include "helicarm/xray/read_dicom.h"
#include "helicarm/xray/read_xray_image.h"
#include "helicarm/xray/uid.h"
#include "helicarm/xray/validated_test.h"

namespace helicarm::xray {
namespace {
namespace fs = std::filesystem;

class WriteDicom : public ::testing::Test {
 protected:
  WriteDicom() : folder_(fs::temp_directory_path() / ("helicarm_write_dicom_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~WriteDicom() override { fs::remove_all(folder_); }
  fs::path folder_;
};

DerivedImage grey_image(int bits) {
  DerivedImage image{.pixels = image::Image<std::uint16_t>(33, 21), .bits_stored = bits, .acquisition = {}};
  unsigned value = 0;
  for (std::uint16_t& pixel : image.pixels.pixels())
    pixel = static_cast<std::uint16_t>((value += 77) & ((1u << bits) - 1));
  return image;
}

TEST_F(WriteDicom, WhatAComputedRadiographCannotStateIsKept) {
  using Change = void (*)(Acquisition&);
  const std::initializer_list<Change> changes = {
      [](Acquisition& a) { a.primary_angle_deg = 30; }, [](Acquisition& a) { a.secondary_angle_deg = -5; },
      [](Acquisition& a) { a.flip_hint = true; }, [](Acquisition& a) { a.logarithmic = true; },
      [](Acquisition& a) { a.logarithmic = false; }};
  for (const Change change : changes) {
    DerivedImage image = grey_image(12);
    image.acquisition.modality = "CR";
    image.acquisition.pixel_mm = Eigen::Vector2d(0.2, 0.2);
    change(image.acquisition);
    ASSERT_TRUE(write_dicom(folder_ / "cr.dcm", image));
    const auto read = read_xray_image(folder_ / "cr.dcm", "AP", {});
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->acquisition.primary_angle_deg, image.acquisition.primary_angle_deg);
    EXPECT_EQ(read->acquisition.secondary_angle_deg, image.acquisition.secondary_angle_deg);
    EXPECT_EQ(read->acquisition.flip_hint, image.acquisition.flip_hint);
    EXPECT_EQ(read->acquisition.logarithmic, image.acquisition.logarithmic);
  }
}

TEST_F(WriteDicom, RoundTripKeepsImageAndTags) {
  for (int bits : {8, 12, 16})
    for (bool rle : {false, true}) {
      DerivedImage image = grey_image(bits);
      image.rle = rle;
      image.acquisition.pixel_mm = Eigen::Vector2d(0.2, 0.3);
      image.acquisition.source_detector_mm = 997.25;
      image.acquisition.primary_angle_deg = -1.5;
      image.acquisition.flip_hint = true;
      image.acquisition.logarithmic = true;
      ASSERT_TRUE(write_dicom(folder_ / "a.dcm", image));
      const auto xray_image = read_xray_image(folder_ / "a.dcm", "AP", {});
      ASSERT_TRUE(xray_image) << xray_image.error().message;
      EXPECT_TRUE(std::ranges::equal(xray_image->pixels.pixels(), image.pixels.pixels()));
      EXPECT_EQ(xray_image->highest, static_cast<float>((1 << bits) - 1));
      const Acquisition& a = xray_image->acquisition;
      EXPECT_EQ(*a.pixel_mm, *image.acquisition.pixel_mm);
      EXPECT_EQ(a.source_detector_mm, 997.25);
      EXPECT_EQ(a.primary_angle_deg, -1.5);
      EXPECT_FALSE(a.secondary_angle_deg.has_value());
      EXPECT_TRUE(a.flip_hint);
      EXPECT_EQ(a.logarithmic, true);
    }
}

TEST_F(WriteDicom, SameUidsGiveTheSameBytes) {
  DerivedImage image = grey_image(12);
  RandomStream random(5, 1);
  for (std::string* uid : {&image.study_uid, &image.series_uid, &image.instance_uid}) *uid = make_uid(random);
  ASSERT_TRUE(write_dicom(folder_ / "a.dcm", image));
  ASSERT_TRUE(write_dicom(folder_ / "b.dcm", image));
  EXPECT_EQ(*read_file(folder_ / "a.dcm", 1 << 20), *read_file(folder_ / "b.dcm", 1 << 20));
}

TEST_F(WriteDicom, ImageOutsideTheLimitsIsRefused) {
  DerivedImage image = grey_image(12);
  image.pixels(3, 3) = 4096;
  EXPECT_EQ(write_dicom(folder_ / "a.dcm", image).error().reason, Reason::bad_value);
  EXPECT_EQ(write_dicom(folder_ / "a.dcm", DerivedImage{}).error().reason, Reason::bad_size);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(WriteDicom, FilesConformToTheStandard) {
  for (const char* modality : {"XA", "RF", "CR", "DX", "SC", ""})
    for (const bool derived : {false, true})
      for (const std::optional<bool> logarithmic : {std::optional<bool>{}, {false}, {true}}) {
        DerivedImage image = grey_image(12);
        image.derived = derived;
        image.acquisition.modality = modality;
        image.acquisition.pixel_mm = Eigen::Vector2d(0.2, 0.3);
        image.acquisition.source_detector_mm = 1000;
        image.acquisition.primary_angle_deg = 30;
        image.acquisition.logarithmic = logarithmic;
        if (image.acquisition.modality == "DX") image.acquisition.technique[0x00200020] = "L\\F";
        if (derived) image.at_object = ObjectSpacing{700, 1000, {0.14, 0.21}, 0.0005, "femur"};
        if (derived) image.derivation = "rectified";
        if (derived) image.source_instance_uid = make_uid();
        ASSERT_TRUE(write_dicom(folder_ / "a.dcm", image));
        const auto errors = validated(folder_ / "a.dcm");
        if (!errors) GTEST_SKIP() << "dciodvfy (dicom3tools) is not installed";
        EXPECT_EQ(*errors, "") << modality << derived;
      }
}

TEST(DicomText, IsOneValueOfWholeCharacters) {
  EXPECT_EQ(whole_characters("a\\b"), "a/b");
  EXPECT_EQ(whole_characters(std::string(63, 'a') + "\u00fc"), std::string(63, 'a'));
  EXPECT_EQ(whole_characters(std::string(62, 'a') + "\u00fc"), std::string(62, 'a') + "\u00fc");
}

TEST_F(WriteDicom, ModalityIsKept) {
  for (const char* modality : {"XA", "RF", "CR", "DX"}) {
    DerivedImage image = grey_image(12);
    image.acquisition.modality = modality;
    image.acquisition.pixel_mm = Eigen::Vector2d(0.2, 0.3);
    if (image.acquisition.modality == "DX") image.acquisition.logarithmic = true;
    ASSERT_TRUE(write_dicom(folder_ / "a.dcm", image));
    EXPECT_EQ(read_xray_image(folder_ / "a.dcm", "AP", {})->acquisition.modality, modality);
  }
}

TEST_F(WriteDicom, WhatGreyValuesAreOfIsNotInvented) {
  DerivedImage image = grey_image(12);
  image.acquisition.modality = "DX";
  image.acquisition.pixel_mm = Eigen::Vector2d(0.2, 0.3);
  ASSERT_TRUE(write_dicom(folder_ / "a.dcm", image));
  EXPECT_FALSE(read_xray_image(folder_ / "a.dcm", "AP", {})->acquisition.logarithmic);
}

TEST_F(WriteDicom, DoseTableUndoesTheLogarithm) {
  DerivedImage image = grey_image(12);
  image.acquisition.logarithmic = true;
  image.log_range = std::log(100);
  ASSERT_TRUE(write_dicom(folder_ / "a.dcm", image));
  DcmFileFormat file;
  ASSERT_TRUE(file.loadFile((folder_ / "a.dcm").c_str()).good());
  DcmItem* table = nullptr;
  ASSERT_TRUE(file.getDataset()->findAndGetSequenceItem(DCM_ModalityLUTSequence, table).good());
  const Uint16* doses = nullptr;
  unsigned long count = 0;
  ASSERT_TRUE(table->findAndGetUint16Array(DCM_LUTData, doses, &count).good());
  ASSERT_EQ(count, 4096u);
  EXPECT_EQ(doses[4095], 65535);
  EXPECT_NEAR(doses[0], 655.35, 0.5);
  EXPECT_NEAR(doses[2048] / 6553.5, 1, 0.002);  // half the range, a tenth of the dose
}

TEST_F(WriteDicom, ImageIsStoredWithItsPatientWhereAsked) {
  DicomBuilder source;
  source.text(0x00080005, "CS", "ISO_IR 100").text(0x00100010, "PN", "M\xFCLLER^EVA");
  source.text(0x0020000D, "UI", "1.2.76543.21")
      .text(0x00080050, "SH", "A17")
      .text(0x00100030, "DA", "19410203");
  ASSERT_TRUE(write_file(folder_ / "source.dcm", source.bytes()));
  const auto xray_image = read_xray_image(folder_ / "source.dcm", "AP", {});
  ASSERT_TRUE(xray_image);
  DerivedImage image = derived_image(*xray_image, xray_image->pixels, "rectified");
  ASSERT_TRUE(write_dicom(folder_ / "plain.dcm", image));
  image.patient_study = *read_patient_study(folder_ / "source.dcm");
  ASSERT_TRUE(write_dicom(folder_ / "kept.dcm", image));

  const auto kept = read_patient_study(folder_ / "kept.dcm");
  for (const auto& [number, value] : image.patient_study->elements)
    EXPECT_EQ(kept->elements.at(number), value);
  const std::string bytes = *read_file(folder_ / "kept.dcm", 1 << 20);
  EXPECT_NE(bytes.find("2.25.17"), bytes.npos);  // the source's UID
  EXPECT_EQ(bytes.find("Nothing of the source"), bytes.npos);
  const std::string plain = *read_file(folder_ / "plain.dcm", 1 << 20);
  for (const char* word : {"LLER", "76543", "A17", "1941"}) EXPECT_EQ(plain.find(word), plain.npos) << word;
}

TEST_F(WriteDicom, AnImageWithItsPatientKeepsItsTimeAsStated) {
  const auto written = [&](const DicomBuilder& source, bool keeps) {
    EXPECT_TRUE(write_file(folder_ / "source.dcm", source.bytes()));
    const auto xray_image = read_xray_image(folder_ / "source.dcm", "AP", {});
    EXPECT_TRUE(xray_image);
    DerivedImage image = derived_image(*xray_image, xray_image->pixels, "rectified");
    if (keeps) image.patient_study = *read_patient_study(folder_ / "source.dcm");
    EXPECT_TRUE(write_dicom(folder_ / "written.dcm", image));
    return *read_file(folder_ / "written.dcm", 1 << 20);
  };
  const auto value = [](const std::string& bytes, std::uint32_t tag) {
    return std::string(walk_dicom(bytes, "written.dcm").value().text({tag, ""}));
  };
  constexpr std::uint32_t acquisition = 0x0008002A, day = 0x00080023, time = 0x00080033, zone = 0x00080201;
  DicomBuilder local, content;
  local.text(acquisition, "DT", "20260228235958.5");
  content.text(day, "DA", "20260228").text(time, "TM", "235958").text(zone, "SH", "+0100");
  EXPECT_EQ(value(written(local, true), acquisition), "20260228235958.5");
  const std::string kept = written(content, true);
  EXPECT_EQ(value(kept, acquisition), "");
  EXPECT_EQ(value(kept, day) + value(kept, time) + value(kept, zone), "20260228225958+0000");
  for (const DicomBuilder& source : {local, content})
    EXPECT_EQ(written(source, false).find("20260228"), std::string::npos);
}

TEST(DerivedImages, OfOneStudyStayInOneStudy) {
  DicomBuilder file;
  file.text(0x0020000D, "UI", "1.2.76543.21");
  const auto source = read_dicom(file.bytes(), "test", {});
  const DerivedImage rectified = derived_image(*source, source->pixels, "rectified");
  const DerivedImage inpainted = derived_image(*source, source->pixels, "inpainted");
  EXPECT_EQ(rectified.study_uid, inpainted.study_uid);
  EXPECT_EQ(rectified.source_instance_uid, inpainted.source_instance_uid);
  EXPECT_NE(rectified.instance_uid, inpainted.instance_uid);
  EXPECT_EQ(rectified.instance_uid, derived_image(*source, source->pixels, "rectified").instance_uid);
}

TEST(Uid, IsARandomUuidInDecimal) {
  const std::string uid = make_uid();
  EXPECT_TRUE(uid.starts_with("2.25."));
  EXPECT_LE(uid.size(), 44u);
  EXPECT_EQ(uid.find_first_not_of("0123456789."), std::string::npos);
  EXPECT_NE(uid, make_uid());
  RandomStream one(1, 2), same(1, 2), other(2, 2);
  const std::string first = make_uid(one);
  EXPECT_EQ(first, make_uid(same));
  EXPECT_NE(first, make_uid(other));
}

}  // namespace
}  // namespace helicarm::xray
