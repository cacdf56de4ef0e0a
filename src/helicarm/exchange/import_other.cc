// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>

#include <fmt/format.h>

#include "helicarm/core/text.h"
#include "helicarm/exchange/import_formats.h"

namespace helicarm::exchange {
namespace {

struct OtherFormat {
  std::string_view mark;
  std::string_view what;  ///< with the way out
  bool anywhere = false;  ///< else at the beginning
};

constexpr OtherFormat other_formats[] = {
    {"#Insight Transform File",
     "an ITK transform, which has no projection: helicarm import prints its matrix"},
    {"\x89HDF",
     "an HDF5 file, which has no projection: of an ITK transform helicarm import prints the matrix; of "
     "MATLAB, write "
     "K, R and t as JSON"},
    {"(Transform ", "elastix's TransformParameters, which is not read: save the transform for ITK (.tfm)",
     true},
    {"MATLAB 5.0", "a file of MATLAB, which is not read: write K, R and t as JSON (jsonencode)"},
    {"\x89PNG", "an image (PNG), not a camera"},
    {"\xFF\xD8\xFF", "an image (JPEG), not a camera"},
    {"II*", "an image (TIFF), not a camera"},
    {"PK\x03\x04", "a ZIP archive (Excel, NumPy .npz), which is not read: save it as text or JSON"},
    {"\x1F\x8B", "compressed (gzip): unpack it; a displacement field (Warp.nii.gz) has no matrix"}};

constexpr std::string_view ants_marks[] = {"AffineTransform_", "MatrixOffsetTransformBase_",
                                           "Euler3DTransform_", "Rigid3DTransform_",
                                           "VersorRigid3DTransform_"};

/// A table "[cam_0]" in the first lines.
bool is_toml(std::string_view text) {
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string line(trimmed(text.substr(at, end - at)));
    at = end + 1;
    if (line.empty() || line[0] == '#') continue;
    const bool table = line.size() > 2 && line[0] == '[' && line.back() == ']' &&
                       line.find(',') == line.npos &&
                       (std::isalpha(static_cast<unsigned char>(line[1])) != 0 || line[1] == '[');
    return table || line.find(" = ") != line.npos;
  }
  return false;
}

}  // namespace

void refuse_other_formats(std::string_view text, const std::string& origin) {
  const std::string_view beginning = text.substr(0, 1000);
  const auto refuse = [&](std::string_view what) {
    throw BadInput(Reason::unsupported, fmt::format("{}: is {}", origin, what));
  };
  if (is_utf_16(text)) refuse("UTF-16: save it as UTF-8");
  for (const auto& [mark, what, anywhere] : other_formats)
    if (beginning.starts_with(mark) || (anywhere && beginning.find(mark) != beginning.npos)) refuse(what);
  if (beginning.substr(std::min<std::size_t>(128, beginning.size())).starts_with("DICM"))
    refuse("a DICOM file, not a camera");
  if (beginning.find('\0') != beginning.npos)
    for (const std::string_view mark : ants_marks)
      if (beginning.find(mark) != beginning.npos)
        refuse("a transform of ANTs (.mat), which is not read: ConvertTransformFile 3 FILE.mat FILE.tfm");
  if (is_toml(beginning))
    refuse(
        "TOML (anipose), which is not read: write a camera's matrix, rotation (as rvec) and translation (as "
        "tvec) as JSON or YAML with OpenCV's keys camera_matrix, rvec, tvec, dist_coeffs");
  if (beginning.find("<?xml") != beginning.npos && text.find("<opencv_storage") == text.npos &&
      !is_rtk_geometry(text))
    refuse("an XML file of neither RTK nor OpenCV");
  if (text.find('\0') != text.npos) refuse("neither MayaCam, NRRD, RTK, OpenCV, JSON nor a text matrix");
}

}  // namespace helicarm::exchange
