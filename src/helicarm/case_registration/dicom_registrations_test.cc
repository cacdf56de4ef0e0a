// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/dicom_registrations.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/xray/dicom_builder.h"
#include "helicarm/xray/dicom_tags.h"

namespace helicarm::case_registration {
namespace dicom_registrations_test {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Optional;

/// A femur in a DICOM series, a tibia in another file.
struct Knee {
  TemporaryFolder folder;
  pipeline::Case the_case;
  CaseRegistration result;

  static xray::DicomBuilder slice() {
    xray::DicomBuilder slice;
    slice.text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.2").text(0x00080018, "UI", "1.2.3.4");
    slice.text(0x00080060, "CS", "CT").text(0x0020000E, "UI", "1.2.3.5").text(0x00200052, "UI", "1.2.3.6");
    slice.text(0x00200037, "DS", "1\\0\\0\\0\\1\\0").text(0x00280030, "DS", "1\\1");
    return slice;
  }
  void put_slice(const std::string& name, int z, xray::DicomBuilder slice) const {
    slice.text(0x00200032, "DS", fmt::format("0\\0\\{}", z));
    EXPECT_TRUE(write_file(folder.path() / "ct" / name, slice.bytes()));
  }

  Knee() {
    for (int i = 0; i < 3; ++i) put_slice(fmt::format("{}.dcm", i + 1), i, slice());
    for (const char* name : {"femur", "tibia"}) {
      the_case.models.emplace_back().name = name;
      result.models.emplace_back().registration.name = name;
    }
    the_case.models[0].volume = folder.path() / "ct";
    the_case.models[1].volume = folder.path() / "ct.nrrd";
    result.models[0].registration.world_from_model.translation = {1, 2, 3};
  }
};

TEST(DicomRegistrations, AreOfTheModelsInADicomSeries) {
  const Knee knee;
  const auto files = write_dicom_registrations(knee.the_case, knee.result, knee.folder.path());
  ASSERT_TRUE(files) << files.error().message;
  EXPECT_THAT(*files, Optional(ElementsAre(knee.folder.path() / "femur_registration.dcm")));
  const std::string bytes = *read_file((**files).front(), 1 << 20);
  EXPECT_THAT(bytes, HasSubstr("1\\0\\0\\1\\0\\1\\0\\2\\0\\0\\1\\3\\0\\0\\0\\1"));
}

TEST(DicomRegistrations, OfALongNameSayTheDirection) {
  Knee knee;
  const std::string before(49, 'f');
  knee.result.models[0].registration.name = before + "\u00fc left femur";
  const auto files = write_dicom_registrations(knee.the_case, knee.result, knee.folder.path());
  ASSERT_TRUE(files && *files) << files.error().message;
  EXPECT_THAT(*read_file((**files).front(), 1 << 20), HasSubstr(before + " to calibrator"));
}

TEST(DicomRegistrations, NameTheSeriesThatIsRead) {
  const Knee knee;
  xray::DicomBuilder localizer = Knee::slice(), other = Knee::slice();
  localizer.text(0x00080008, "CS", "ORIGINAL\\PRIMARY\\LOCALIZER").text(0x00200052, "UI", "1.2.3.99");
  other.text(0x0020000E, "UI", "1.2.3.98").text(0x00200052, "UI", "1.2.3.97").text(0x00100020, "LO", "WRONG");
  knee.put_slice("0.dcm", 0, localizer);
  for (int i = 0; i < 2; ++i) knee.put_slice(fmt::format("0{}.dcm", i), i, other);
  const auto files = write_dicom_registrations(knee.the_case, knee.result, knee.folder.path());
  ASSERT_TRUE(files && *files) << files.error().message;
  const std::string bytes = *read_file((**files).front(), 1 << 20);
  EXPECT_THAT(bytes, HasSubstr("1.2.3.6"));
  for (const char* foreign : {"1.2.3.99", "1.2.3.97", "WRONG"}) EXPECT_THAT(bytes, Not(HasSubstr(foreign)));
}

TEST(DicomRegistrations, ARefusedModelHasNone) {
  Knee knee;
  knee.result.models[0].registration.failure = Failure{Reason::wrong_model, "", "", {}};
  EXPECT_TRUE(write_dicom_registrations(knee.the_case, knee.result, knee.folder.path())->value().empty());
}

TEST(DicomRegistrations, WithoutASeriesThereAreNone) {
  Knee knee;
  knee.the_case.models[0].volume = knee.folder.path();
  EXPECT_EQ(write_dicom_registrations(knee.the_case, knee.result, knee.folder.path()).value(), std::nullopt);
}

}  // namespace dicom_registrations_test
}  // namespace helicarm::case_registration
