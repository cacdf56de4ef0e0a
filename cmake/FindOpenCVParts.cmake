# Debian's OpenCV component packages ship no CMake configuration of their own; the whole one drags in Qt and GDAL.
set(_found TRUE)
find_path(OpenCVParts_INCLUDE_DIR opencv2/core.hpp PATH_SUFFIXES opencv4)
foreach(_part core imgproc photo)
  find_library(OpenCVParts_${_part}_LIBRARY opencv_${_part})
  if(OpenCVParts_${_part}_LIBRARY AND OpenCVParts_INCLUDE_DIR)
    if(NOT TARGET OpenCVParts::${_part})
      add_library(OpenCVParts::${_part} UNKNOWN IMPORTED)
      set_target_properties(OpenCVParts::${_part} PROPERTIES
        IMPORTED_LOCATION ${OpenCVParts_${_part}_LIBRARY}
        INTERFACE_INCLUDE_DIRECTORIES ${OpenCVParts_INCLUDE_DIR})
    endif()
  else()
    set(_found FALSE)
  endif()
endforeach()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenCVParts REQUIRED_VARS OpenCVParts_INCLUDE_DIR OpenCVParts_core_LIBRARY
                                  OpenCVParts_imgproc_LIBRARY OpenCVParts_photo_LIBRARY)
