# Flags shared by every unit of the project. The instruction set is uniform because Eigen's alignment is ABI.
add_library(helicarm_flags INTERFACE)
target_compile_options(helicarm_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wno-aggressive-loop-optimizations)
# Nobody reads errno or floating-point flags: without them loops with a root or a comparison become vectors.
target_compile_options(helicarm_flags INTERFACE -fno-math-errno -fno-trapping-math)
target_include_directories(helicarm_flags INTERFACE ${CMAKE_SOURCE_DIR}/src)
target_compile_definitions(helicarm_flags INTERFACE HELICARM_VERSION="${PROJECT_VERSION}")
if(HELICARM_WERROR)
  target_compile_options(helicarm_flags INTERFACE -Werror)
endif()
if(NOT HELICARM_PORTABLE)
  target_compile_options(helicarm_flags INTERFACE -march=x86-64-v3)
endif()
if(HELICARM_SANITIZE STREQUAL "thread")
  # GCC warns that it does not instrument fences; std::atomic_thread_fence occurs in Asio alone.
  target_compile_options(helicarm_flags INTERFACE -fsanitize=thread -fno-omit-frame-pointer -Wno-tsan)
  target_link_options(helicarm_flags INTERFACE -fsanitize=thread)
elseif(HELICARM_SANITIZE)
  target_compile_options(helicarm_flags INTERFACE -fsanitize=address,undefined -fno-sanitize-recover=all
                         -fno-omit-frame-pointer)
  target_link_options(helicarm_flags INTERFACE -fsanitize=address,undefined)
endif()
if(HELICARM_FUZZ)
  target_compile_options(helicarm_flags INTERFACE -fsanitize=fuzzer-no-link,address,undefined,float-cast-overflow
                         -fno-sanitize-recover=all -fno-omit-frame-pointer -Wno-unknown-warning-option)
  target_link_options(helicarm_flags INTERFACE -fsanitize=address,undefined)
endif()

# Eigen, JSON and fmt are most of what the compiler reads: it reads them once.
add_library(helicarm_precompiled OBJECT ${CMAKE_SOURCE_DIR}/cmake/precompiled.cc)
target_link_libraries(helicarm_precompiled PRIVATE helicarm_flags Eigen3::Eigen nlohmann_json::nlohmann_json fmt::fmt
                      tl::expected)
set(helicarm_often_included <algorithm> <cmath> <filesystem> <functional> <map> <optional> <string> <vector>
    <Eigen/Dense> <fmt/format.h> <nlohmann/json.hpp> <tl/expected.hpp>)
target_precompile_headers(helicarm_precompiled PRIVATE ${helicarm_often_included})
add_library(helicarm_precompiled_tests OBJECT ${CMAKE_SOURCE_DIR}/cmake/precompiled.cc)
target_link_libraries(helicarm_precompiled_tests PRIVATE helicarm_flags Eigen3::Eigen nlohmann_json::nlohmann_json
                      fmt::fmt tl::expected GTest::gmock)
target_precompile_headers(helicarm_precompiled_tests PRIVATE ${helicarm_often_included}
                          <gmock/gmock.h> <gtest/gtest.h>)

# helicarm_module(NAME [APART] [TESTS_APART] SOURCES a.cc ... USES room ... LIBRARIES target ... TESTS a_test.cc ...)
# A room's files are compiled as one unit, and its tests in groups; APART, TESTS_APART: file by file, as they use one
# name for several things.
function(helicarm_module name)
  cmake_parse_arguments(ARG "APART;TESTS_APART" "" "SOURCES;USES;LIBRARIES;TESTS;TEST_USES" ${ARGN})
  list(TRANSFORM ARG_USES PREPEND helicarm_)
  list(TRANSFORM ARG_TEST_USES PREPEND helicarm_)
  if(ARG_SOURCES)
    add_library(helicarm_${name} STATIC ${ARG_SOURCES})
    target_link_libraries(helicarm_${name} PUBLIC helicarm_flags ${ARG_USES} ${ARG_LIBRARIES})
    target_precompile_headers(helicarm_${name} REUSE_FROM helicarm_precompiled)
    if(HELICARM_UNITY AND NOT ARG_APART)
      set_target_properties(helicarm_${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
    endif()
  else()
    add_library(helicarm_${name} INTERFACE)
    target_link_libraries(helicarm_${name} INTERFACE helicarm_flags ${ARG_USES} ${ARG_LIBRARIES})
  endif()
  if(ARG_TESTS)
    add_executable(${name}_test ${ARG_TESTS})
    target_link_libraries(${name}_test PRIVATE helicarm_${name} ${ARG_TEST_USES} GTest::gmock GTest::gtest_main)
    target_precompile_headers(${name}_test REUSE_FROM helicarm_precompiled_tests)
    if(HELICARM_UNITY AND NOT ARG_TESTS_APART)
      set_target_properties(${name}_test PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 6)
    endif()
    # GCC 12 sees string literals overrun where std::string moves them (GCC bug 105329).
    target_compile_options(${name}_test PRIVATE -Wno-array-bounds -Wno-restrict -Wno-stringop-overflow)
    gtest_discover_tests(${name}_test TEST_PREFIX ${name}. DISCOVERY_TIMEOUT 60)
  endif()
endfunction()
