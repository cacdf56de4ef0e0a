// SPDX-License-Identifier: Apache-2.0
// itk_peer volumes FOLDER COUNT SEED   writes volumes of random geometry, type and compression, and what ITK
// reads back itk_peer transforms FOLDER COUNT SEED   writes transforms, and where they map three points
// itk_peer read-volume FILE   prints size and index-to-physical matrix, and writes the voxels to FILE.raw
// itk_peer read-transform FILE   prints where it maps three points
#include <fstream>
#include <iomanip>
#include <iostream>
#include <random>
#include <string>

#include <itkAffineTransform.h>
#include <itkEuler3DTransform.h>
#include <itkImage.h>
#include <itkImageFileReader.h>
#include <itkImageFileWriter.h>
#include <itkImageRegionIterator.h>
#include <itkTransformFileReader.h>
#include <itkTransformFileWriter.h>
#include <itkVersion.h>
#include <itkVersorRigid3DTransform.h>

namespace {

using Random = std::mt19937;

double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

itk::Versor<double> any_turn(Random& random) {
  std::normal_distribution<double> normal;
  itk::Versor<double> turn;
  turn.Set(normal(random), normal(random), normal(random), normal(random));
  return turn;
}

template <class Pixel>
void describe(const std::string& file, std::ostream& out) {
  using Image = itk::Image<Pixel, 3>;
  const auto image = itk::ReadImage<Image>(file);
  const auto size = image->GetLargestPossibleRegion().GetSize();
  out << file;
  for (int i = 0; i < 3; ++i) out << ' ' << size[i];
  typename Image::PointType origin, next;
  image->TransformIndexToPhysicalPoint({{0, 0, 0}}, origin);
  for (int axis = 0; axis < 3; ++axis) {
    typename Image::IndexType one{{0, 0, 0}};
    one[axis] = 1;
    image->TransformIndexToPhysicalPoint(one, next);
    for (int i = 0; i < 3; ++i) out << ' ' << next[i] - origin[i];
  }
  for (int i = 0; i < 3; ++i) out << ' ' << origin[i];
  out << '\n';
  std::ofstream raw(file + ".raw", std::ios::binary);
  itk::ImageRegionConstIterator<Image> voxel(image, image->GetLargestPossibleRegion());
  for (; !voxel.IsAtEnd(); ++voxel) {
    const double value = double(voxel.Get());
    raw.write(reinterpret_cast<const char*>(&value), sizeof value);
  }
}

template <class Pixel>
void write_volume(const std::string& file, Random& random) {
  using Image = itk::Image<Pixel, 3>;
  const auto image = Image::New();
  typename Image::SizeType size;
  for (int i = 0; i < 3; ++i) size[i] = 2 + random() % 7;
  image->SetRegions(size);
  image->Allocate();
  typename Image::SpacingType spacing;
  typename Image::PointType origin;
  for (int i = 0; i < 3; ++i) {
    spacing[i] = between(random, 0.2, 3);
    origin[i] = between(random, -300, 300);
  }
  typename Image::DirectionType direction = any_turn(random).GetMatrix();
  if (random() % 2 == 0)
    for (int i = 0; i < 3; ++i) direction[i][0] *= -1;
  image->SetSpacing(spacing);
  image->SetOrigin(origin);
  image->SetDirection(direction);
  itk::ImageRegionIterator<Image> voxel(image, image->GetLargestPossibleRegion());
  const double low = std::is_unsigned_v<Pixel> ? 0 : std::is_same_v<Pixel, signed char> ? -128 : -3000;
  const double high = sizeof(Pixel) == 1 ? 127 : 3000;
  for (; !voxel.IsAtEnd(); ++voxel) voxel.Set(Pixel(between(random, low, high)));
  const auto writer = itk::ImageFileWriter<Image>::New();
  writer->SetInput(image);
  writer->SetFileName(file);
  writer->SetUseCompression(random() % 2 == 0);
  writer->Update();
  describe<Pixel>(file, std::cout);
}

void write_volumes(const std::string& folder, int count, Random& random) {
  const char* const endings[] = {"mha", "mhd", "nrrd", "nhdr", "nii", "nii.gz"};
  for (int n = 0; n < count; ++n) {
    const std::string file = folder + "/v" + std::to_string(n) + "." + endings[n % 6];
    switch (n / 6 % 7) {
      case 0:
        write_volume<unsigned char>(file, random);
        break;
      case 1:
        write_volume<signed char>(file, random);
        break;
      case 2:
        write_volume<short>(file, random);
        break;
      case 3:
        write_volume<unsigned short>(file, random);
        break;
      case 4:
        write_volume<int>(file, random);
        break;
      case 5:
        write_volume<float>(file, random);
        break;
      default:
        write_volume<double>(file, random);
    }
  }
}

using Transform = itk::Transform<double, 3, 3>;

void say_places(const std::string& file, const Transform& transform) {
  std::cout << file;
  const double points[3][3] = {{0, 0, 0}, {100, -50, 30}, {-80, 120, 200}};
  for (const auto& point : points) {
    const auto place = transform.TransformPoint(itk::Point<double, 3>(point));
    for (int i = 0; i < 3; ++i) std::cout << ' ' << place[i];
  }
  std::cout << '\n';
}

template <class Kind>
typename Kind::Pointer centred(Random& random) {
  const auto transform = Kind::New();
  typename Kind::InputPointType centre;
  typename Kind::OutputVectorType shift;
  for (int i = 0; i < 3; ++i) {
    centre[i] = between(random, -100, 100);
    shift[i] = between(random, -100, 100);
  }
  transform->SetCenter(centre);
  transform->SetTranslation(shift);
  return transform;
}

void write_transforms(const std::string& folder, int count, Random& random) {
  for (int n = 0; n < count; ++n) {
    Transform::Pointer transform;
    if (n % 3 == 0) {
      const auto euler = centred<itk::Euler3DTransform<double>>(random);
      euler->SetRotation(between(random, -1.5, 1.5), between(random, -3, 3), between(random, -3, 3));
      transform = euler.GetPointer();
    } else if (n % 3 == 1) {
      const auto versor = centred<itk::VersorRigid3DTransform<double>>(random);
      versor->SetRotation(any_turn(random));
      transform = versor.GetPointer();
    } else {
      const auto affine = centred<itk::AffineTransform<double, 3>>(random);
      affine->SetMatrix(any_turn(random).GetMatrix());
      transform = affine.GetPointer();
    }
    const std::string file = folder + "/t" + std::to_string(n) + (n / 3 % 2 == 0 ? ".tfm" : ".h5");
    const auto writer = itk::TransformFileWriterTemplate<double>::New();
    writer->SetInput(transform);
    writer->SetFileName(file);
    writer->Update();
    say_places(file, *transform);
  }
}

void read_transform(const std::string& file) {
  const auto reader = itk::TransformFileReaderTemplate<double>::New();
  reader->SetFileName(file);
  reader->Update();
  say_places(file, dynamic_cast<const Transform&>(*reader->GetTransformList()->front()));
}

}  // namespace

int main(int count, char** words) try {
  std::cout << std::setprecision(17);
  const std::string what = count > 1 ? words[1] : "";
  if (what == "version") {
    std::cout << itk::Version::GetITKVersion() << '\n';
  } else if (count == 3 && what == "read-volume") {
    describe<double>(words[2], std::cout);
  } else if (count == 3 && what == "read-transform") {
    read_transform(words[2]);
  } else if (count == 5 && (what == "volumes" || what == "transforms")) {
    Random random(static_cast<unsigned>(std::stoul(words[4])));
    what == "volumes" ? write_volumes(words[2], std::stoi(words[3]), random)
                      : write_transforms(words[2], std::stoi(words[3]), random);
  } else {
    return 2;
  }
} catch (const std::exception& error) {
  std::cerr << error.what() << '\n';
  return 1;
}
