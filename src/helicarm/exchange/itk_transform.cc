// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/itk_transform.h"

#include <array>
#include <cmath>
#include <sstream>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/exchange/hdf5_file.h"
#include "helicarm/exchange/import_formats.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::exchange {
namespace {

using ItkRows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr std::uintmax_t most_bytes = 1u << 20;
constexpr std::string_view itk_mark = "#Insight Transform File";

struct ItkFile {
  std::string type;
  std::vector<double> parameters, fixed;
};

[[noreturn]] void refuse_several(const std::string& origin) {
  throw BadInput(Reason::unsupported,
                 fmt::format("{}: holds several transforms; harden or combine them into one", origin));
}

ItkFile itk_file_from(const std::string& text, const std::string& origin) {
  ItkFile file;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const auto colon = line.find(':');
    if (line.starts_with('#') || colon == line.npos) continue;
    const std::string name(trimmed(std::string_view(line).substr(0, colon))), value = line.substr(colon + 1);
    if (name == "Transform" && !file.type.empty()) refuse_several(origin);
    if (name == "Transform") file.type = trimmed(value);
    if (name == "Parameters") file.parameters = numbers_in(value, origin + ": Parameters");
    if (name == "FixedParameters") file.fixed = numbers_in(value, origin + ": FixedParameters");
  }
  return file;
}

Eigen::Matrix3d turn(double angle, const Eigen::Vector3d& axis) {
  return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

Eigen::Matrix3d euler_rotation(const ItkFile& file) {
  const auto x = turn(file.parameters[0], Eigen::Vector3d::UnitX());
  const auto y = turn(file.parameters[1], Eigen::Vector3d::UnitY());
  const auto z = turn(file.parameters[2], Eigen::Vector3d::UnitZ());
  const bool zyx = file.fixed.size() > 3 && file.fixed[3] != 0;
  return zyx ? Eigen::Matrix3d(z * y * x) : Eigen::Matrix3d(z * x * y);
}

/// The quaternion's vector part; its scalar part is not negative.
Eigen::Matrix3d versor_rotation(const ItkFile& file, const std::string& origin) {
  const Eigen::Vector3d v(file.parameters.data());
  if (v.norm() > 1 + 1e-6)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: Parameters: the versor's length is {:g}, limit 1", origin, v.norm()));
  return Eigen::Quaterniond(std::sqrt(std::max(0.0, 1 - v.squaredNorm())), v.x(), v.y(), v.z())
      .normalized()
      .toRotationMatrix();
}

Eigen::Matrix3d quaternion_rotation(const ItkFile& file, const std::string& origin) {
  const Eigen::Quaterniond q(file.parameters[3], file.parameters[0], file.parameters[1], file.parameters[2]);
  if (!(std::abs(q.norm() - 1) < 1e-3))
    throw BadInput(
        Reason::bad_value,
        fmt::format("{}: Parameters: the quaternion's length is {:g}, must be 1", origin, q.norm()));
  return q.normalized().toRotationMatrix();
}

enum class ItkKind { matrix, euler, versor, quaternion, translation };

struct ItkType {
  std::string_view name;
  ItkKind kind;
  std::size_t parameters;  ///< the last three are the translation
};

const ItkType& type_named(const std::string& type_name, const std::string& origin) {
  static constexpr std::array types{ItkType{"AffineTransform", ItkKind::matrix, 12},
                                    ItkType{"MatrixOffsetTransformBase", ItkKind::matrix, 12},
                                    ItkType{"Rigid3DTransform", ItkKind::matrix, 12},
                                    ItkType{"Euler3DTransform", ItkKind::euler, 6},
                                    ItkType{"VersorRigid3DTransform", ItkKind::versor, 6},
                                    ItkType{"QuaternionRigidTransform", ItkKind::quaternion, 7},
                                    ItkType{"TranslationTransform", ItkKind::translation, 3}};
  if (type_name.empty()) throw BadInput(Reason::truncated, fmt::format("{}: Transform is missing", origin));
  const std::string name = type_name.substr(0, type_name.find('_'));
  for (const ItkType& type : types)
    if (type.name == name && (type_name.ends_with("_double_3_3") || type_name.ends_with("_float_3_3")))
      return type;
  throw BadInput(Reason::unsupported,
                 fmt::format("{}: a transform {} is not read; save a linear one of 3D space", origin,
                             type_name.substr(0, 60)));
}

/// Groups, datasets and, before ITK 5, their misspelt names as in ITK's HDF5TransformIO.
ItkFile itk_file_from_hdf5(std::string_view bytes, const std::string& origin) {
  const Hdf5File hdf5(bytes, origin);
  const auto root = hdf5.root();
  const auto group = root.find("TransformGroup");
  if (group == root.end())
    throw BadInput(Reason::unsupported,
                   fmt::format("{}: an HDF5 file without TransformGroup is no ITK transform", origin));
  const auto transforms = hdf5.links(group->second);
  if (transforms.size() > 1) refuse_several(origin);
  if (transforms.empty()) return {};
  const auto fields = hdf5.links(transforms.begin()->second);
  const auto numbers = [&](const std::string& name) {
    for (const std::string beginning : {"Transform", "Tranform"})
      if (const auto found = fields.find(beginning + name); found != fields.end())
        return hdf5.numbers(found->second);
    return std::vector<double>();
  };
  ItkFile file;
  if (const auto type = fields.find("TransformType"); type != fields.end())
    file.type = hdf5.text(type->second);
  type_named(file.type, origin);  // first: transforms of other types have more numbers
  file.parameters = numbers("Parameters");
  file.fixed = numbers("FixedParameters");
  return file;
}

geometry::RigidTransform rigid_from(const ItkFile& file, const std::string& origin) {
  const ItkType& type = type_named(file.type, origin);
  if (file.parameters.size() != type.parameters)
    throw BadInput(Reason::bad_size, fmt::format("{}: Parameters: {} numbers, must be {}", origin,
                                                 file.parameters.size(), type.parameters));
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  auto rotation = matrix.topLeftCorner<3, 3>();
  if (type.kind == ItkKind::matrix) rotation = Eigen::Map<const ItkRows>(file.parameters.data());
  if (type.kind == ItkKind::euler) rotation = euler_rotation(file);
  if (type.kind == ItkKind::versor) rotation = versor_rotation(file, origin);
  if (type.kind == ItkKind::quaternion) rotation = quaternion_rotation(file, origin);
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  if (type.kind != ItkKind::translation && !file.fixed.empty()) {
    if (file.fixed.size() != 3 && file.fixed.size() != 4)
      throw BadInput(Reason::bad_size, fmt::format("{}: FixedParameters: {} numbers, must be 3: the centre",
                                                   origin, file.fixed.size()));
    centre = Eigen::Vector3d(file.fixed.data());
  }
  const Eigen::Vector3d translation(file.parameters.data() + file.parameters.size() - 3);
  matrix.topRightCorner<3, 1>() = translation + centre - rotation * centre;
  return value_or_throw(geometry::rigid_transform_from(matrix, origin + ": Parameters"));
}

}  // namespace

Expected<std::optional<geometry::RigidTransform>> read_itk_transform(const std::filesystem::path& path) {
  const auto text = read_file(path, most_bytes);
  // A larger file is no transform; `import_matrix` names what is wrong with it.
  if (!text && text.error().reason == Reason::missing_file) return tl::unexpected<Failure>(text.error());
  const bool hdf5 = text && Hdf5File::is_one(*text);
  if (!text || (!hdf5 && !text->starts_with(itk_mark))) return std::nullopt;
  return guarded([&]() -> std::optional<geometry::RigidTransform> {
    const std::string origin = path.filename().string();
    return rigid_from(hdf5 ? itk_file_from_hdf5(*text, origin) : itk_file_from(*text, origin), origin);
  });
}

std::string itk_transform_text(const geometry::RigidTransform& moving_from_fixed) {
  std::string text =
      fmt::format("{} V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\nParameters:", itk_mark);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) text += fmt::format(" {}", moving_from_fixed.rotation(i, j));
  for (int i = 0; i < 3; ++i) text += fmt::format(" {}", moving_from_fixed.translation[i]);
  return text + "\nFixedParameters: 0 0 0\n";
}

}  // namespace helicarm::exchange
