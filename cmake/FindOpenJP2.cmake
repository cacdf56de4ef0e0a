# Debian's OpenJPEG configuration demands the programs beside the library.
find_path(OpenJP2_INCLUDE_DIR openjpeg.h PATH_SUFFIXES openjpeg-2.5 openjpeg-2.4 openjpeg-2.3)
find_library(OpenJP2_LIBRARY openjp2)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenJP2 REQUIRED_VARS OpenJP2_LIBRARY OpenJP2_INCLUDE_DIR)
if(OpenJP2_FOUND AND NOT TARGET OpenJP2::OpenJP2)
  add_library(OpenJP2::OpenJP2 UNKNOWN IMPORTED)
  set_target_properties(OpenJP2::OpenJP2 PROPERTIES
    IMPORTED_LOCATION ${OpenJP2_LIBRARY} INTERFACE_INCLUDE_DIRECTORIES ${OpenJP2_INCLUDE_DIR})
endif()
