# Compile settings that every target shares, and the one-target-a-folder helper.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()
set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")

find_program(PARALLAX_CCACHE ccache)
if(PARALLAX_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${PARALLAX_CCACHE})
endif()
find_program(PARALLAX_MOLD mold)
if(PARALLAX_MOLD)
  add_link_options(-fuse-ld=mold)
endif()

add_library(parallax_settings INTERFACE)
target_include_directories(parallax_settings INTERFACE "${PROJECT_SOURCE_DIR}")
target_compile_options(parallax_settings INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Wcast-qual -Wno-unused-parameter
  -fno-math-errno -fno-trapping-math -ffp-contract=off)
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # GCC 12 sees overlaps in std::string's operator+ that are not there (GCC bug 105651).
  target_compile_options(parallax_settings INTERFACE -Wno-restrict)
endif()
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # Sources joined into one look like headers to this warning.
  target_compile_options(parallax_settings INTERFACE -Wno-subobject-linkage)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_FLAGS MATCHES "-fsanitize=")
  # With a sanitizer, GCC 12 takes Eigen's inlined transposes for reads of what was never written.
  target_compile_options(parallax_settings INTERFACE -Wno-maybe-uninitialized)
endif()
if(CMAKE_CXX_COMPILER_ID MATCHES Clang)
  target_compile_options(parallax_settings INTERFACE -Wthread-safety)
  if(PARALLAX_WARNINGS_AS_ERRORS)
    target_compile_options(parallax_settings INTERFACE -Werror=thread-safety)
  endif()
endif()
if(PARALLAX_WARNINGS_AS_ERRORS)
  target_compile_options(parallax_settings INTERFACE -Werror)
endif()

# Headers of packages that most sources include, compiled once: a fifth of the time of a library's source, half of a
# test's. Off, every source stands on its own includes; the `clang` preset sees to that.
option(PARALLAX_PRECOMPILE "Precompile the headers of packages" OFF)
if(PARALLAX_PRECOMPILE AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # For ccache; and GCC 12 warns of std::string's own copies once they come out of a precompiled header (bug 105651 again).
  target_compile_options(parallax_settings INTERFACE -fpch-preprocess -Wno-stringop-overflow -Wno-stringop-overread
    -Wno-array-bounds)
  if(PARALLAX_CCACHE)
    set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${PARALLAX_CCACHE})
  endif()
endif()
set(PARALLAX_PRECOMPILED
  <Eigen/Core> <Eigen/Geometry> <algorithm> <array> <cmath> <cstdint> <functional> <memory> <opencv2/core.hpp> <optional> <random>
  <string> <vector>)

# parallax_precompiled(TARGET FROM): the target uses what FROM compiled. FROM is made at its first use, with further
# headers, definitions and options.
function(parallax_precompiled target from)
  cmake_parse_arguments(ARG "" "" "HEADERS;DEFINITIONS;OPTIONS;LIBS" ${ARGN})
  if(NOT PARALLAX_PRECOMPILE)
    return()
  endif()
  if(NOT TARGET ${from})
    set(source "${PROJECT_BINARY_DIR}/generated/${from}.cpp")
    if(NOT EXISTS "${source}")
      file(WRITE "${source}" "int main() {}  // the headers are what is compiled\n")
    endif()
    get_target_property(type ${target} TYPE)
    if(type STREQUAL EXECUTABLE)  # compiled with other flags than a library
      add_executable(${from} "${source}")
    else()
      add_library(${from} OBJECT "${source}")
    endif()
    target_link_libraries(${from} PRIVATE parallax_settings ${ARG_LIBS})
    target_include_directories(${from} SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
    target_compile_definitions(${from} PRIVATE ${ARG_DEFINITIONS})
    target_compile_options(${from} PRIVATE ${ARG_OPTIONS})
    set_target_properties(${from} PROPERTIES UNITY_BUILD OFF)
    target_precompile_headers(${from} PRIVATE ${PARALLAX_PRECOMPILED} ${ARG_HEADERS})
  endif()
  target_precompile_headers(${target} REUSE_FROM ${from})
endfunction()

# The folders that read outside bytes: under a fuzzer they count where it has been.
set(PARALLAX_FUZZED core camera solver map place sessions)

# parallax_library(NAME [PUBLIC lib...] [PRIVATE lib...]): every .cpp in the folder NAME.
function(parallax_library name)
  cmake_parse_arguments(ARG "" "" "PUBLIC;PRIVATE" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/${name}/*.cpp" "${PROJECT_SOURCE_DIR}/${name}/*.h")
  add_library(parallax_${name} STATIC ${sources})
  set_target_properties(parallax_${name} PROPERTIES LINKER_LANGUAGE CXX)
  # OpenCV's and Eigen's headers warn under C++20, so what comes from packages is a system header.
  foreach(lib IN LISTS ARG_PUBLIC ARG_PRIVATE)
    if(TARGET ${lib})
      get_target_property(dirs ${lib} INTERFACE_INCLUDE_DIRECTORIES)
      if(dirs AND NOT lib MATCHES "^parallax_")
        target_include_directories(parallax_${name} SYSTEM PUBLIC ${dirs})
      endif()
    endif()
  endforeach()
  target_link_libraries(parallax_${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE} parallax_settings)
  if(PARALLAX_BUILD_FUZZERS AND name IN_LIST PARALLAX_FUZZED)
    target_compile_options(parallax_${name} PRIVATE -fsanitize=fuzzer-no-link)
    parallax_precompiled(parallax_${name} parallax_fuzzed_headers OPTIONS -fsanitize=fuzzer-no-link LIBS Eigen3::Eigen opencv_core)
  else()
    parallax_precompiled(parallax_${name} parallax_headers LIBS Eigen3::Eigen opencv_core)
  endif()
endfunction()
