// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/matrix_transform.h"

#include "helicarm/exchange/import_text_test.h"

namespace helicarm::exchange {
namespace {

Expected<std::optional<geometry::RigidTransform>> read_4x4(const std::string& text) {
  return read_matrix_transform(WrittenFile(text).path);
}

TEST(MatrixTransform, TextAndJsonAreRead) {
  for (const char* text :
       {"0 -1 0 5\n1 0 0 6\n0 0 1 7\n0 0 0 1\n", "# pose\n0,-1,0,5\n+1,0,0,6\n0,0,1,7\n0,0,0,1",
        "[[0,-1,0,5],[1,0,0,6],[0,0,1,7],[0,0,0,1]]",
        "{\"world_from_model\": [[0,-1,0,5],[1,0,0,6],[0,0,1,7],[0,0,0,1]]}"}) {
    const auto read = read_4x4(text);
    ASSERT_TRUE(read && *read) << text;
    EXPECT_EQ(**read * Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(3, 7, 10));
  }
}

TEST(MatrixTransform, OtherFilesAreNone) {
  for (const char* text :
       {"1 2 3 4\n", "hello\n", "{\"K\": 3}", "4000 0 512 1\n0 4000 500 1\n0 0 1 700\n0 0 0 1\n",
        "1 0 0 5\n0 1 0 6\n0 0 1 7\n"}) {
    const auto read = read_4x4(text);
    ASSERT_TRUE(read) << text;
    EXPECT_FALSE(*read) << text;
  }
}

TEST(MatrixTransform, TransposedOneIsNamed) {
  const auto refused = read_4x4("0 1 0 0\n-1 0 0 0\n0 0 1 0\n5 6 7 1\n");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_NE(refused.error().message.find("transposed"), std::string::npos);
}

}  // namespace
}  // namespace helicarm::exchange
