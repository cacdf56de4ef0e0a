// SPDX-License-Identifier: Apache-2.0
// What OpenIGTLink's library receives: openigtlink_peer PORT COUNT FOLDER prints a line for each message.
// TRANSFORM: device and the matrix by rows; IMAGE: device, size, scalar type, spacing, matrix, and the pixels
// in FOLDER/DEVICE.raw.
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include <igtlClientSocket.h>
#include <igtlImageMessage.h>
#include <igtlMessageHeader.h>
#include <igtlTransformMessage.h>

namespace {

void print(const igtl::Matrix4x4& matrix) {
  for (const auto& row : matrix)
    for (const float number : row) std::printf(" %.9g", double(number));
}

template <class Message>
typename Message::Pointer received(igtl::ClientSocket& socket, igtl::MessageHeader::Pointer& header) {
  auto message = Message::New();
  message->SetMessageHeader(header);
  message->AllocatePack();
  socket.Receive(message->GetPackBodyPointer(), message->GetPackBodySize());
  if (!(message->Unpack(1) & igtl::MessageHeader::UNPACK_BODY)) std::exit(3);
  return message;
}

}  // namespace

int main(int, char** argv) {
  const auto socket = igtl::ClientSocket::New();
  if (socket->ConnectToServer("127.0.0.1", std::atoi(argv[1])) != 0) return 2;
  const int count = std::atoi(argv[2]);
  for (int i = 0; i < count; ++i) {
    auto header = igtl::MessageHeader::New();
    header->InitPack();
    if (socket->Receive(header->GetPackPointer(), header->GetPackSize()) != header->GetPackSize()) return 4;
    header->Unpack();
    const std::string type = header->GetDeviceType(), device = header->GetDeviceName();
    std::printf("%s %s", type.c_str(), device.c_str());
    if (type == "TRANSFORM") {
      igtl::Matrix4x4 matrix;
      received<igtl::TransformMessage>(*socket, header)->GetMatrix(matrix);
      print(matrix);
    } else if (type == "IMAGE") {
      const auto image = received<igtl::ImageMessage>(*socket, header);
      int size[3];
      float spacing[3];
      igtl::Matrix4x4 matrix;
      image->GetDimensions(size);
      image->GetSpacing(spacing);
      image->GetMatrix(matrix);
      std::printf(" %d %d %d %d %d %d", size[0], size[1], size[2], image->GetScalarType(), image->GetEndian(),
                  image->GetCoordinateSystem());
      std::printf(" %.9g %.9g %.9g", double(spacing[0]), double(spacing[1]), double(spacing[2]));
      print(matrix);
      std::ofstream(std::string(argv[3]) + "/" + device + ".raw", std::ios::binary)
          .write(static_cast<const char*>(image->GetScalarPointer()), image->GetImageSize());
    } else {
      return 5;
    }
    std::printf("\n");
  }
  return 0;
}
