include(GNUInstallDirs)
# Flags of the project's own units; a user's units get none of them.
add_library(helicarm_flags INTERFACE)
# Eigen's alignment is part of the binary interface and follows the instruction set unless it is fixed. This one
# definition goes with the libraries to their users, so that a library with AVX2 serves a program without.
set(helicarm_abi EIGEN_MAX_STATIC_ALIGN_BYTES=32 EIGEN_MAX_ALIGN_BYTES=32)
target_compile_definitions(helicarm_flags INTERFACE ${helicarm_abi})
target_compile_options(helicarm_flags INTERFACE -Wall -Wextra -Wpedantic)
# Nobody reads errno or floating-point flags: without them loops with a root or a comparison become vectors.
target_compile_options(helicarm_flags INTERFACE -fno-math-errno -fno-trapping-math)
# For all units, as programs and the Python module share libraries and precompiled headers. Functions may still be
# inlined: nothing replaces them at run time.
target_compile_options(helicarm_flags INTERFACE -fPIC -fno-semantic-interposition)
target_include_directories(helicarm_flags INTERFACE ${PROJECT_SOURCE_DIR}/src)
target_compile_definitions(helicarm_flags INTERFACE HELICARM_VERSION="${PROJECT_VERSION}")
if(HELICARM_WERROR)
  target_compile_options(helicarm_flags INTERFACE -Werror)
endif()
# GCC collects garbage only above this many kB: up to a fifth of a large unit's time.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(helicarm_flags INTERFACE -Wshadow -Wno-aggressive-loop-optimizations
                         "SHELL:--param ggc-min-heapsize=1000000")
endif()
# A header precompiled by Clang holds the time unless told not to, and ccache then serves no unit that reads it. Its
# -Wshadow would also name what other files of a unity unit declare.
if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  target_compile_options(helicarm_flags INTERFACE "SHELL:-Xclang -fno-pch-timestamp")
endif()
if(NOT HELICARM_PORTABLE)
  target_compile_options(helicarm_flags INTERFACE -march=x86-64-v3)
endif()
if(HELICARM_SANITIZE STREQUAL "thread")
  # GCC warns that it does not instrument fences; std::atomic_thread_fence occurs in Asio alone.
  target_compile_options(helicarm_flags INTERFACE -fsanitize=thread -fno-omit-frame-pointer
    $<$<CXX_COMPILER_ID:GNU>:-Wno-tsan>)
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

# A faster linker where there is one; GCC takes mold's name from version 12.1 on.
find_program(HELICARM_MOLD mold)
mark_as_advanced(HELICARM_MOLD)
if(PROJECT_IS_TOP_LEVEL AND HELICARM_MOLD AND NOT HELICARM_SANITIZE AND NOT HELICARM_FUZZ)
  target_link_options(helicarm_flags INTERFACE -fuse-ld=mold)
endif()

# Eigen, JSON and fmt are most of what the compiler reads: it reads them once.
add_library(helicarm_precompiled OBJECT ${PROJECT_SOURCE_DIR}/cmake/precompiled.cc)
target_link_libraries(helicarm_precompiled PRIVATE helicarm_flags Eigen3::Eigen nlohmann_json::nlohmann_json fmt::fmt
                      tl::expected)
set(helicarm_often_included <algorithm> <cmath> <filesystem> <functional> <map> <optional> <string> <vector>
    <Eigen/Dense> <fmt/format.h> <nlohmann/json.hpp> <tl/expected.hpp>)
target_precompile_headers(helicarm_precompiled PRIVATE ${helicarm_often_included})
if(HELICARM_TESTS)
  # What a test itself does is not worth the optimiser's time; what it tests is optimised in its library.
  set(helicarm_test_options $<$<CONFIG:Release>:-O1>)
  add_library(helicarm_precompiled_tests OBJECT ${PROJECT_SOURCE_DIR}/cmake/precompiled.cc)
  target_link_libraries(helicarm_precompiled_tests PRIVATE helicarm_flags Eigen3::Eigen nlohmann_json::nlohmann_json
                        fmt::fmt tl::expected GTest::gmock)
  target_compile_options(helicarm_precompiled_tests PRIVATE ${helicarm_test_options})
  target_precompile_headers(helicarm_precompiled_tests PRIVATE ${helicarm_often_included}
                            <gmock/gmock.h> <gtest/gtest.h>)
endif()

# Within this project whatever links a module is compiled with the project's flags; users of the library are not.
if(PROJECT_IS_TOP_LEVEL)
  set(helicarm_flags_scope PUBLIC)
else()
  set(helicarm_flags_scope PRIVATE)
endif()

# What a user of a module's headers compiles with.
function(helicarm_public target scope)
  target_include_directories(${target} ${scope} $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>
                                                $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_definitions(${target} ${scope} ${helicarm_abi})
  target_compile_features(${target} ${scope} cxx_std_20)
endfunction()

# Of modules in which little of a run's time is spent: Clang takes a fifth less for them. GCC's precompiled header is of one
# level of optimisation.
set(helicarm_cold_options $<$<AND:$<CONFIG:Release>,$<CXX_COMPILER_ID:Clang>>:-O1>)

# helicarm_module(NAME [APART] [COLD] [PRIVATE] SOURCES a.cc ... USES module ... LIBRARIES target ... TESTS a_test.cc ...
#                 TESTS_TOGETHER Suite ...)
# A module's files are compiled as one unit, and its tests in groups; APART: file by file, as they use one
# name for several things. COLD: with `helicarm_cold_options`. PRIVATE: no part of the installed library. TESTS_TOGETHER: suites that share what is dear to
# make, each one test of ctest.
function(helicarm_module name)
  cmake_parse_arguments(ARG "APART;COLD;PRIVATE" "" "SOURCES;USES;LIBRARIES;TESTS;TEST_USES;TESTS_TOGETHER" ${ARGN})
  list(TRANSFORM ARG_USES PREPEND helicarm_)
  list(TRANSFORM ARG_TEST_USES PREPEND helicarm_)
  if(ARG_SOURCES)
    add_library(helicarm_${name} STATIC ${ARG_SOURCES})
    target_link_libraries(helicarm_${name} ${helicarm_flags_scope} $<BUILD_INTERFACE:helicarm_flags>)
    target_link_libraries(helicarm_${name} PUBLIC ${ARG_USES} ${ARG_LIBRARIES})
    helicarm_public(helicarm_${name} PUBLIC)
    target_precompile_headers(helicarm_${name} REUSE_FROM helicarm_precompiled)
    if(ARG_COLD)
      target_compile_options(helicarm_${name} PRIVATE ${helicarm_cold_options})
    endif()
    if(HELICARM_UNITY AND NOT ARG_APART)
      set_target_properties(helicarm_${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
    endif()
  else()
    add_library(helicarm_${name} INTERFACE)
    target_link_libraries(helicarm_${name} INTERFACE ${ARG_USES} ${ARG_LIBRARIES})
    helicarm_public(helicarm_${name} INTERFACE)
  endif()
  add_library(helicarm::${name} ALIAS helicarm_${name})
  if(HELICARM_INSTALL AND NOT ARG_PRIVATE)
    helicarm_install_module(${name})
  endif()
  if(ARG_TESTS AND HELICARM_TESTS)
    add_executable(${name}_test ${ARG_TESTS})
    target_link_libraries(${name}_test PRIVATE helicarm_${name} ${ARG_TEST_USES} GTest::gmock GTest::gtest_main)
    target_compile_options(${name}_test PRIVATE ${helicarm_test_options})
    target_precompile_headers(${name}_test REUSE_FROM helicarm_precompiled_tests)
    if(HELICARM_UNITY)
      set_target_properties(${name}_test PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 8)
    endif()
    # GCC 12 sees string literals overrun where std::string moves them (GCC bug 105329).
    target_compile_options(${name}_test PRIVATE
                           "$<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds;-Wno-restrict;-Wno-stringop-overflow>")
    list(TRANSFORM ARG_TESTS_TOGETHER APPEND ".*" OUTPUT_VARIABLE together)
    list(JOIN together ":" together)
    gtest_discover_tests(${name}_test TEST_PREFIX ${name}. TEST_FILTER "-${together}" DISCOVERY_TIMEOUT 60)
    foreach(suite IN LISTS ARG_TESTS_TOGETHER)
      add_test(NAME ${name}.${suite} COMMAND ${name}_test --gtest_filter=${suite}.*)
    endforeach()
  endif()
endfunction()

# Adds the unit of cmake/commit.cmake to a program, which states it in program_commit().
function(helicarm_with_commit target)
  set(unit ${PROJECT_BINARY_DIR}/commit.cc)
  if(NOT TARGET helicarm_commit)
    add_custom_target(helicarm_commit BYPRODUCTS ${unit} VERBATIM COMMAND ${CMAKE_COMMAND} -DSOURCE=${PROJECT_SOURCE_DIR}
                      -DOUT=${unit} -P ${PROJECT_SOURCE_DIR}/cmake/commit.cmake)
  endif()
  set_source_files_properties(${unit} PROPERTIES GENERATED ON SKIP_UNITY_BUILD_INCLUSION ON SKIP_PRECOMPILE_HEADERS ON)
  target_sources(${target} PRIVATE ${unit})
  add_dependencies(${target} helicarm_commit)
endfunction()
