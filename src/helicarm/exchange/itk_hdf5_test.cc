// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <zlib.h>

#include "helicarm/core/failure.h"
#include "helicarm/exchange/hdf5_file.h"
#include "helicarm/exchange/import_text_test.h"
#include "helicarm/exchange/itk_transform.h"

namespace helicarm::exchange {
namespace {

// Written by HDF5 1.10.8 in ITK's layout: the first transform of ItkTypes; then compressed by zlib.
const std::string contiguous =
    "78daed5acd6ed34010deb5dd60152152c4c12515f8c84f895ca5957a8b114e1a44d5443442dc92a01a11d12495d348e9"
    "8d23dc38024fc0913720576e1ce1c62b708353c876671def161c04e44f99efe0cfbb3bdab5c7339ed1ecbe2c78f90bcb"
    "579609836912832449147dc0abdb725b8c578129f00be0779ae8a7a76316f4afc0fcaa5cf9412ec7a4fb0ac43a8ec1d9"
    "258845442177a7c4f83db44bc09f53e35d979204b76d2adadc9229a592dd0bd607e3ec7e757061969e0cc7ccd3ebd280"
    "595bd378b709f3e9140414ffbb04dd4c78fd87f18c90ee54bfc3fe5ed1a383b710fedc5d8a97879722b61e2f775dfc3f"
    "12f1728e602b5e4efc275e9f93bf8fbb0affadd474ed79727695b4e6c1ae26a70f7b4ef4f1ebb8a9daef6fe3eb1ac4d7"
    "abf1eb30f74d9a43ddeedc2deed2887a68448e612b9d49331f84b04d84bb6ea4379cf436fb2eb2fc6ebdd9619a84f01d"
    "f2d6403e2a27dc31d739f4838c570e6acdf69356d0a81cb43a8f0ffd4aa692919ebb7a11632202814020100804028140"
    "20107f8b44a41ea029f5019d4cb24ee3d87c86d9aed38cdcb780c2a689a6b59010fb168f886ccdcf95fab3a3f84de13f"
    "ad7faf7cffa11fb4ebad26ccebe5a576717fafd6f0194bdd242cc0ed04adced1f0b9aa53f2a3ee0df423f4a3b3fb7f5f"
    "d7c7bbeee4e29d3b17f1ce88e403ec3e15690fb7022fbb9cad1ee735f7ed1b868f59ce5f3e70fe96e5e3df810d90f75c"
    "b47804028140206607fcfc4f785889f494f3357f7aee00f5c8f4a887e7367a37e3e5b7813fdd8a970bcf5b5d5b0c3d8e"
    "cacff5302f97f3f3153b0bba72c9e679b2d9d789929f6b4a7e5e82fcdc9ae9fc7c943ec4799dc43febe3a92d572e6653"
    "1f44ad67944f8efc683b5feffa07a55a506bf8c77ed03e23af0c8dbb0ef21300d7cb99";

const std::string deflated =
    "78daed9acd6f124114c0dfec52d8b45641a3a1d2e87af323926d80c8c58816286a03c492c653016549887cd4a52478eb"
    "d19ebc9a78f4e2d1c47f808b270f36f162fc0b7aec49e30919985976b76535469622ef77e0edccbccc2cb3efedbc9d79"
    "7ba9787271fee23c5024095ce005235dc6e16d7399b71798244cbe64f29dc0eb49bfcdcfea7dac7fab5eee512241b5bb"
    "16f8388a6b206380cc22a9c4dd2c95ef5939cbe4d7c078c725e01ed836e1e5812513424c76cfa5d86ba7d74bbd1f6ae9"
    "5ebd4deaffcef5242d0bc2a05a62fd89842958fcef2caba6ca377fba9e01b427fa1c36d29938e9fd0beecfed397b7df6"
    "a74016edf5aef2f787db5e4fe1d26fafc7df13af3de6e7135b62efadc064edd939bbf2faa7c1ae9c9b0f794ae6e3f875"
    "d36abf23d7d765b6be5eb21f87baaf571aceedda6a669d18a68718f428916028487d902ddbc0dd7525b8a204a3f4b998"
    "f5d72bf5169d49b67ceb32d2d337ea71774cb4aaaa168ae7b462bd596e68b57ca9d17a5255f3a17cc874df8533b82622"
    "088220088220088220c8dfe236ec070896fd01119cdca751e4410f277b9fe6b7e7166c635342d39a49f8b9c563305bf3"
    "ae65ff59b1f84dea1f8d7f3ff77053d59a95469df51b4f9aca998d74b1a65269aa067d036e4d6bb4b687f75598901fb5"
    "afa11fa11f1d3dfff346c63bae73eb5d6c2ad63b97211ea0d7014399c60aedada705203e8ff2517e0ef73e4501160fc8"
    "5e7beb4de49c2bfdedb3f0e5d68fd58357df4f150ec5071f9677f783a74179eb3b8f068e20088220279841fe8f9eac04"
    "1d4b7ecd9fe61de03cd27914f5bc8dce757bfd28bf08dbebe9f9569767631e09786ce373518fcbcdf1b94fbec3e62a06"
    "e10508774530c7e7a2d0ef6001e47e99e8fd4bfd8c9b925aae1677543d7f458fe30561ffc6704869741c9f1ddb773439"
    "e63bfac208fdac6c2e8b80dfd90882200832ebf113cfef753b173f7522c3211d8f9ff4388a9f7fe45e6cabc672b2d256"
    "4bd9a256aca93baad63ca26f6972e2dce4b878efca08fdb225de7363bc8720088220ff3dbf0021d3f579";

const std::string of_floats =
    "78daebf47071e3e592e262e2e0608081ff50d0a000e11b40c50d54a4f2fd3d5c829814747fb26423e30a2621648d30c0"
    "c5c4c0c8c0c026ca00a4b83c43bcc3528b8a33f3f30e43cd834a005d0095b8cf08911010606078c60a615b3120c48ca1"
    "620a70a77a3be698829da488ee2406464611060626462080aa85d1cc220c8c92408e00030443c439185881ae6566e200"
    "fa849991011a1a02308b36300c3960f6e6d55a5a848d80c4d00f9b637f392ed3226c148641d8cc3cb8fd002dc2c66018"
    "84cd96acda73fece1ede6c22203f72fa07434b2e711688bcc9929446728a481e90718c060a6c507b3ca8e7e4bb46ccdf"
    "c14e1604d9c1e61fec97989bfa9b095a044b8204f9428a12f38ad3f28b72dd8bf24b0b82a1c5ecb7c0babbe478460264"
    "262fdccc90ca82d4cd508fb12983e424e0726e9915a929018945402795004332400251d89f6787b0b51890d29af4ea99"
    "5db4489b0ec3206dea041c480647b41cc88fc2f03046046f8e244465b16afa14a82650540b702002ccddd9df87112924"
    "1891d48180a99eb11ea83dc004abc3a1b4a19ea1819e053028d1d4fb64e69556006968fe80d3a640f5c8eaa4a0b46b69"
    "4e6a91b10bdcf1f16939f98925f1c6f1c6a89e4de0671805a360148c8251300a46c1281805a360148c8251300a460199"
    "800d693c80096d7c8019da7f87f159a0fd76181fa496d0e00c6c7c004e8b30300a2ad843c7db1d184cb8194cfe0325c1"
    "83335c90c1990005885a09982387e0e0cce68d616708850d1b521c20c2461e3a66a2c020cec1205ecf801a3619c3206c"
    "fcaa97888fe6bc51300a46c128180e40c4015a2b1d80d0320e67cff8d89d3d7366dfd9333df60c0c0780580128a7e004"
    "006ed2071e";

const std::string latest =
    "78daebf47071e3e592e262e6e0608081ff50d0ae00e11b40c5abf56325fd3d5c829814747fb26423e30a2621648d30c0"
    "c5c4c0c8c0c026ca00a4b83c43bcc3528b8a33f3f30e43cd834a005d0095b8cf08911010606078c60a615b3120c48ca1"
    "620a70a77a3be698829da488ee2406464611060626462080aa85d1cc220c8c92408e00030443c439185881ae6566e200"
    "fa848591011a1a02308b36300c39f05a2e613a2dc2464062e8874d1fffdd4a5a848dc230081b01ce5311b4081b836110"
    "360c0d4f2bfc9d3dbcd944407ee4f40f86965ce22c10699325298de414913c20e3180d14d8a0d67850cfc5778d98bf83"
    "9d2c08b283cd3fd82f3137f53713b408960409f2851425e615a7e517e5ba17e5971604438bd96f817577c9f18c04c84c"
    "5eb899219505a99ba11e635306c949c0e5dc322b525302128b804e2a0186648004a2b03fcf0e616b3120a535e9d533bb"
    "6891361d8641dab4d4da37131cd172203f0ac3c31811bc39921095c5aae953a09a40512dc081083077677f1f46a49060"
    "44520702a67ac67aa0f60013ac0e87d2867a86067a16c0c04653ef9399575a01a4a1f9034e9b02d523ab9386d2aea539"
    "a945c62e70c7c7a7e49726e5a4c61bc71ba37836819f61148c8251300a46c1281805a360148c8251300a46c128180564"
    "0236a4f10026b4f1016668ff1dc66781f6db617c905a428333b0f101382dc2c028a8600f1d6f776030e16630f90f9404"
    "0fce7073f33030027581c6c6c0a673c8006d6562626264e66014437275800294316db086ebe4b7ce9b09850d1b521c50"
    "10366c1c8c8a4836a70dfab0897f7362c568ce1b05a360148c82a10d2ae2921380b516bbc151854206a7d3160c0cbc2f"
    "183b2be2669b0ab3f8dd3acf74d9fcbbf38bfe6f3c091f98bd36cb345cd0e36330582c280a00ada70ed8";

std::string unpacked(const std::string& hex) {
  std::string packed, raw(20'000, '\0');
  for (std::size_t i = 0; i < hex.size(); i += 2) packed += char(std::stoi(hex.substr(i, 2), nullptr, 16));
  uLongf size = raw.size();
  EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(raw.data()), &size,
                       reinterpret_cast<const Bytef*>(packed.data()), packed.size()),
            Z_OK);
  return raw.substr(0, size);
}

Expected<std::optional<geometry::RigidTransform>> read_bytes(const std::string& bytes) {
  return read_itk_transform(WrittenFile(bytes).path);
}

Reason reason_of_bytes(const std::string& bytes) {
  const auto refused = read_bytes(bytes);
  EXPECT_FALSE(refused);
  return refused ? Reason::usage : refused.error().reason;
}

/// Everything that the file holds, as the reader of transforms takes it.
void read_all(const std::string& bytes) {
  (void)guarded([&] {
    const Hdf5File file(bytes, "file");
    const auto root = file.root();
    const auto group = root.find("TransformGroup");
    if (group == root.end()) return;
    for (const auto& [name, address] : file.links(group->second))
      for (const auto& [field, dataset] : file.links(address))
        (void)guarded(
            [&] { field.ends_with("Type") ? void(file.text(dataset)) : void(file.numbers(dataset)); });
  });
}

class ItkHdf5 : public testing::TestWithParam<std::pair<std::string, double>> {};

TEST_P(ItkHdf5, MapsAPoint) {
  const auto read = read_bytes(unpacked(GetParam().first));
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_TRUE(*read);
  const Eigen::Vector3d mapped(-14.087686753324526, -2.9040206793126018, 74.83580732778242);
  EXPECT_LT((**read * Eigen::Vector3d(10, 20, 30) - mapped).norm(), GetParam().second);
}

INSTANTIATE_TEST_SUITE_P(Layouts, ItkHdf5,
                         testing::Values(std::pair{contiguous, 1e-9}, std::pair{deflated, 1e-9},
                                         std::pair{of_floats, 1e-5}, std::pair{latest, 1e-9}));

TEST(ItkHdf5File, NamesOfFormerVersionsAreRead) {
  std::string old = unpacked(contiguous);
  for (const std::string name : {"TransformParameters", "TransformFixedParameters"})
    old = replaced(old, name + '\0', "Tran" + name.substr(5) + std::string(2, '\0'));
  const auto read = read_bytes(old);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ((*read)->matrix(), (*read_bytes(unpacked(contiguous)))->matrix());
}

TEST(ItkHdf5File, WhatIsNoRigidTransformIsNamed) {
  const std::string good = unpacked(contiguous);
  EXPECT_EQ(reason_of_bytes(replaced(good, "Euler3D", "Scale3D")), Reason::unsupported);
  EXPECT_EQ(reason_of_bytes(replaced(good, "_double_3_3", "_double_2_2")), Reason::unsupported);
  EXPECT_EQ(reason_of_bytes(replaced(good, "TransformGroup", "TransformGroop")), Reason::unsupported);
  EXPECT_EQ(reason_of_bytes(replaced(good, "TransformParameters", "TransformParametres")), Reason::bad_size);
  EXPECT_EQ(reason_of_bytes(replaced(good, "TransformType", "TransformTyqe")), Reason::truncated);
  const std::string forty("\0\0\0\0\0\0\x44\x40", 8), infinite("\0\0\0\0\0\0\xF0\x7F", 8);
  EXPECT_EQ(reason_of_bytes(replaced(good, forty, infinite)), Reason::not_finite);
  EXPECT_EQ(reason_of_bytes(good.substr(0, 100)), Reason::truncated);
}

TEST(ItkHdf5File, NoTruncatedFileIsReadBeyondItsEnd) {
  const std::string good = unpacked(of_floats);
  for (std::size_t size = 0; size < good.size(); ++size) {
    const std::string copy(good, 0, size);
    EXPECT_NO_THROW(read_all(copy)) << size;
  }
}

TEST(ItkHdf5File, ChangedBytesAreReadOrRefused) {
  for (const std::string& hex : {contiguous, deflated, of_floats, latest}) {
    std::string bytes = unpacked(hex);
    for (char& byte : bytes)
      for (const int bits : {1, 0x80, 0xFF}) {
        byte = char(byte ^ bits);
        EXPECT_NO_THROW(read_all(bytes));
        byte = char(byte ^ bits);
      }
  }
}

}  // namespace
}  // namespace helicarm::exchange
