// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/reconstruction.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <functional>

#include <Eigen/Core>
#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>

#include "helicarm/core/files.h"
#include "helicarm/core/statistics.h"
#include "helicarm/core/system_message.h"
#include "helicarm/core/temporary_folder.h"

extern char** environ;  // NOLINT(readability-redundant-declaration): POSIX declares it nowhere

namespace helicarm::sweep {
namespace {

constexpr std::uintmax_t most_bytes = 1 << 28;

/// Runs a program that is looked for in PATH, its output into a file. Returns its exit code.
int run_program(const std::vector<std::string>& words, const std::filesystem::path& output) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC,
                                   0600);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  pid_t child = 0;
  const int error = posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error)
    throw BadInput(Reason::missing_file, fmt::format("{}: {}", words.front(), system_message(error)));
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

std::string last_line(const std::string& text) {
  const std::size_t end = text.find_last_not_of(" \n\r\t");
  if (end == std::string::npos) return "";
  const std::size_t begin = text.find_last_of('\n', end);
  return text.substr(begin == std::string::npos ? 0 : begin + 1,
                     end - (begin == std::string::npos ? -1 : begin));
}

Reconstruction read_floats(const std::filesystem::path& file, const std::array<int, 3>& size,
                           double voxel_mm) {
  const std::string bytes = value_or_throw(read_file(file, most_bytes));
  constexpr std::string_view end_of_header = "ElementDataFile = LOCAL\n";
  const std::size_t header = bytes.find(end_of_header);
  Reconstruction volume{size, voxel_mm, {}};
  volume.values.resize(std::size_t(size[0]) * std::size_t(size[1]) * std::size_t(size[2]));
  const std::size_t wanted = volume.values.size() * sizeof(float);
  if (header == std::string::npos || bytes.size() - header - end_of_header.size() != wanted)
    throw BadInput(Reason::unsupported, fmt::format("{}: is not the volume asked for", file.string()));
  std::memcpy(volume.values.data(), bytes.data() + header + end_of_header.size(), wanted);
  return volume;
}

/// Level of what surrounds the target: the median of the faces across x and y of one slice or all.
double level_around(const Reconstruction& volume, int first_z, int end_z, double& scatter) {
  std::vector<double> faces;
  const auto [nx, ny, nz] = volume.size;
  for (int z = first_z; z < end_z; ++z) {
    for (int x = 0; x < nx; ++x)
      for (const int y : {0, ny - 1}) faces.push_back(volume.at(x, y, z));
    for (int y = 1; y + 1 < ny; ++y)
      for (const int x : {0, nx - 1}) faces.push_back(volume.at(x, y, z));
  }
  const double level = median(faces);
  for (double& value : faces) value = std::abs(value - level);
  scatter = median(std::move(faces));
  return level;
}

/// Mean squared distance from their middle, along `axes` axes, of the voxels of slices above half of the
/// contrast between the level around and the mean of the `highest` voxels, in voxels; nothing where that is
/// noise. Metal may be dark or bright.
std::optional<double> spread_above_half(const Reconstruction& volume, int first_z, int end_z,
                                        std::size_t highest, Eigen::Index axes) {
  constexpr double least_contrast = 8;  // times the scatter
  double scatter = 0;
  const double level = level_around(volume, first_z, end_z, scatter);
  const std::size_t slice = std::size_t(volume.size[0]) * std::size_t(volume.size[1]);
  const auto first = volume.values.begin() + std::ptrdiff_t(slice) * first_z,
             end = volume.values.begin() + std::ptrdiff_t(slice) * end_z;
  const auto [lowest, top] = std::minmax_element(first, end);
  const double sign = *top - level >= level - *lowest ? 1 : -1;
  std::vector<double> ranked;
  for (auto value = first; value != end; ++value) ranked.push_back(sign * (*value - level));
  highest = std::clamp<std::size_t>(highest, 1, ranked.size());
  std::ranges::nth_element(ranked, ranked.begin() + std::ptrdiff_t(highest) - 1, std::greater<>());
  double peak = 0;
  for (std::size_t i = 0; i < highest; ++i) peak += ranked[i] / double(highest);
  if (!(peak > least_contrast * scatter)) return {};
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), squares = Eigen::Vector3d::Zero();
  double count = 0;
  for (int z = first_z; z < end_z; ++z)
    for (int y = 0; y < volume.size[1]; ++y)
      for (int x = 0; x < volume.size[0]; ++x) {
        if (sign * (volume.at(x, y, z) - level) < peak / 2) continue;
        const Eigen::Vector3d at(x, y, z);
        sum += at, squares += at.cwiseAbs2(), count += 1;
      }
  constexpr double within_voxel = 1.0 / 12;
  return (squares / count - (sum / count).cwiseAbs2()).head(axes).sum() + within_voxel * double(axes);
}

}  // namespace

Expected<std::string> version_of(const std::string& program) {
  return guarded([&] {
    const TemporaryFolder folder;
    const std::filesystem::path output = folder.path() / "version.txt";
    run_program({program, "--version"}, output);
    const std::string text = value_or_throw(read_file(output, most_bytes));
    return text.substr(0, text.find('\n'));
  });
}

Expected<Reconstruction> reconstruct(const std::string& program, const std::filesystem::path& folder,
                                     const std::array<int, 3>& size, double voxel_mm) {
  return guarded([&] {
    const std::filesystem::path volume = folder / "volume.mha", output = folder / "output.txt";
    const auto three = [](double x, double y, double z) { return fmt::format("{} {} {}", x, y, z); };
    const int code = run_program({program, "fdk", "-I", folder.string(), "-O", volume.string(), "-f", "ramp",
                                  "-r", three(size[0], size[1], size[2]), "-z",
                                  three(size[0] * voxel_mm, size[1] * voxel_mm, size[2] * voxel_mm)},
                                 output);
    if (code != 0 || !std::filesystem::exists(volume))
      throw BadInput(
          Reason::unsupported,
          fmt::format("{} fdk ends with exit code {}: {}", program, code,
                      last_line(read_file(output, most_bytes).value_or(std::string("no output")))));
    return read_floats(volume, size, voxel_mm);
  });
}

std::optional<double> ball_width_mm(const Reconstruction& volume, double nominal_mm) {
  constexpr double share_of_ball = 0.1;             // whose mean is the maximum: one voxel alone is noise
  constexpr double diameter2_by_spread = 20.0 / 3;  // of a ball
  const double ball = std::pow(nominal_mm / volume.voxel_mm, 3) * EIGEN_PI / 6;
  const auto spread = spread_above_half(volume, 0, volume.size[2], std::size_t(share_of_ball * ball) + 1, 3);
  if (!spread) return {};
  return std::sqrt(diameter2_by_spread * *spread) * volume.voxel_mm;
}

std::optional<double> wire_width_mm(const Reconstruction& volume) {
  constexpr std::size_t highest = 4;
  constexpr double diameter2_by_spread = 8;  // of a circle
  double sum = 0;
  for (int z = 0; z < volume.size[2]; ++z) {
    const auto spread = spread_above_half(volume, z, z + 1, highest, 2);
    if (!spread) return {};
    sum += std::sqrt(diameter2_by_spread * *spread) * volume.voxel_mm;
  }
  return sum / volume.size[2];
}

image::Image<std::uint8_t> middle_slice(const Reconstruction& volume) {
  const auto [nx, ny, nz] = volume.size;
  double scatter = 0;
  const double level = level_around(volume, 0, nz, scatter);
  const auto [lowest, highest] = std::ranges::minmax_element(volume.values);
  const double sign = *highest - level >= level - *lowest ? 1 : -1;
  const double range = std::max(1e-9, sign > 0 ? *highest - level : level - *lowest);
  image::Image<std::uint8_t> slice(nx, ny);
  for (int y = 0; y < ny; ++y)
    for (int x = 0; x < nx; ++x)
      slice(x, y) = std::uint8_t(
          std::clamp(std::lround(255 * sign * (volume.at(x, y, nz / 2) - level) / range), 0L, 255L));
  return slice;
}

}  // namespace helicarm::sweep
