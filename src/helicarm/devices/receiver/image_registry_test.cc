// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/image_registry.h"

#include <fstream>
#include <future>

#include <gtest/gtest.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/xray/dicom_builder.h"

namespace helicarm::receiver {
namespace {

namespace fs = std::filesystem;

class ImageSources : public testing::Test {
 protected:
  ImageSources() {
    fs::create_directory(share_);
    std::ofstream(share_ / "knee", std::ios::binary) << xray::DicomBuilder().bytes();
    std::ofstream(share_ / "letter", std::ios::binary) << "no image";
  }

  /// The image that the source takes, within its own file name or connection.
  void expect_image_from(const ImageSourceOptions& options) {
    std::promise<Arrival> arrived;
    std::promise<Failure> refused;
    const auto source = open_images(options, *inbox_,
                                    {[&](const Arrival& a) { arrived.set_value(a); },
                                     [&](const Failure& why) { refused.set_value(why); }});
    ASSERT_TRUE(source) << source.error().message;
    EXPECT_EQ(arrived.get_future().get().path, temporary_.path() / "inbox" / "2.25.17.dcm");
    EXPECT_EQ(refused.get_future().get().reason, Reason::not_an_image);
    EXPECT_EQ((*source)->port(), 0);
    EXPECT_EQ((*source)->broken(), 0u);
  }

  TemporaryFolder temporary_;
  fs::path share_ = temporary_.path() / "share";
  std::unique_ptr<Inbox> inbox_ = Inbox::open(temporary_.path() / "inbox").value();
};

TEST_F(ImageSources, FolderIsWatched) {
  expect_image_from(FolderOptions{.folder = share_, .pause = std::chrono::milliseconds(5)});
}

TEST_F(ImageSources, ListedFilesAreTakenOnce) {
  expect_image_from(FileList{{share_ / "knee", share_ / "letter"}});
}

TEST_F(ImageSources, ReceiverListens) {
  ReceiverOptions options;
  options.port = 0;
  const auto source = open_images(options, *inbox_);
  ASSERT_TRUE(source) << source.error().message;
  EXPECT_NE((*source)->port(), 0);
}

TEST_F(ImageSources, MissingFolderIsRefused) {
  const auto source = open_images(FolderOptions{.folder = share_ / "none"}, *inbox_);
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().reason, Reason::missing_file);
}

}  // namespace
}  // namespace helicarm::receiver
