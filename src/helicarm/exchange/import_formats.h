// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/text.h"
#include "helicarm/exchange/import_matrix.h"

/// The parts of `import_matrix`. All throw BadInput; `origin` and `where` begin the message.
namespace helicarm::exchange {

inline constexpr int largest_side_px = 16384;
inline constexpr std::size_t most_cameras = 10000;  // of one file
inline constexpr double largest_number = 1e12;

using Cameras = std::vector<ImportedMatrix>;

std::string without_byte_order_mark(const std::string& text);
std::vector<double> numbers_in(std::string_view text, const std::string& where);
/// Width, height; two whole numbers.
Eigen::Vector2i image_size_from(const std::vector<double>& numbers, const std::string& where);
/// From the 12 numbers of a 3x4 matrix, row by row.
ImportedMatrix imported(const std::vector<double>& numbers, const std::string& where);
/// From K (9 numbers, upper triangular, ends in 1), R (9) and t (3).
geometry::View camera_of(const std::vector<double>& k, const std::vector<double>& r,
                         const std::vector<double>& t, const std::string& origin);

/// A key without case, underscores, hyphens, blanks and points.
std::string key_word(std::string_view key);
/// Whether a key names a lens distortion: dist..., D, kc, k1, p2, lens, xi, ...
bool names_lens(std::string_view key);
/// OpenCV's k1, k2, p1, p2, k3, ...: refused unless all are 0 or `options.undistorted`.
void refuse_lens_distortion(const std::vector<double>& coefficients, const std::string& where,
                            const ImportOptions& options);
/// The same for every key of a file that names a lens, and for models that are no pinhole.
void refuse_lens(const Json& camera, const std::string& origin, const ImportOptions& options);
/// `unsupported`, with the way out, where the beginning of a file tells another program's format.
void refuse_other_formats(std::string_view text, const std::string& origin);

/// A text of a file, with the names of the elements or keys around it: "/RTK.../Projection/Matrix".
struct FileField {
  std::string path;
  std::string text;
};
/// One for each element, in the order in which they end. Neither entities nor CDATA.
std::vector<FileField> xml_fields(std::string_view text, const std::string& origin);
/// What cv::FileStorage reads of YAML (also without its first line) or XML; "~" is null.
Json file_storage_json(std::string_view text, const std::string& origin);

bool is_rtk_geometry(std::string_view text);
Cameras parse_rtk_geometry(std::string_view text, const std::string& origin, const ImportOptions& options);
bool is_opencv_file(std::string_view text);
Cameras parse_opencv_camera(std::string_view text, const std::string& origin, const ImportOptions& options);
/// A camera by OpenCV's keys; several of its table of poses.
Cameras camera_of_keys(const Json& json, const std::string& origin, const ImportOptions& options);
ImportedMatrix parse_maya_cam(const std::string& text, const std::string& origin,
                              const ImportOptions& options);
/// The five lines of MayaCam 1.
ImportedMatrix from_maya_cam_1(const std::vector<std::vector<double>>& rows, const std::string& origin,
                               const ImportOptions& options);

/// TIGRE's, LEAP's, DiffDRR's or DeepDRR's geometry of a run as `run_geometry.h` writes it.
bool is_run_geometry(const Json& json);
Cameras cameras_of_run(const Json& json, const std::string& origin);
/// ASTRA's cone_vec, 12 numbers a row. Needs the image size (`usage`).
Cameras cameras_of_astra(const std::vector<std::vector<double>>& rows, const std::string& origin,
                         const ImportOptions& options);

/// A table with the heading view,p11,...,p34.
bool is_matrix_table(std::string_view text);
Cameras parse_matrix_table(std::string_view text, const std::string& origin);
/// NumPy's array (3, 4) or (n, 3, 4) of floats.
bool is_numpy_array(std::string_view bytes);
Cameras parse_numpy_array(std::string_view bytes, const std::string& origin);
/// plastimatch's projection matrix file.
bool is_plastimatch_matrix(std::string_view text);
ImportedMatrix parse_plastimatch_matrix(std::string_view text, const std::string& origin);

}  // namespace helicarm::exchange
