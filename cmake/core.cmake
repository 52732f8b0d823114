# The library of all numerics; knows nothing of Python.
file(GLOB_RECURSE core_sources CONFIGURE_DEPENDS cpp/src/*.cpp)
add_library(stretchmap_core STATIC ${core_sources})
target_include_directories(stretchmap_core PUBLIC cpp/include PRIVATE cpp/src)
find_package(Threads REQUIRED)
target_link_libraries(stretchmap_core PUBLIC Eigen3::Eigen Threads::Threads)
target_compile_definitions(stretchmap_core PUBLIC EIGEN_DONT_PARALLELIZE EIGEN_MPL2_ONLY)
target_precompile_headers(stretchmap_core PRIVATE <stretchmap/base/types.hpp> <string> <vector>)

if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64" AND NOT CMAKE_OSX_ARCHITECTURES MATCHES "arm64")
  set(x86 ON)
else()
  set(x86 OFF)
endif()
if(MSVC)
  # Templates make more sections than an object file has by default.
  set(warnings /W3)
  target_compile_options(stretchmap_core PRIVATE ${warnings} /bigobj /utf-8)
else()
  set(warnings -Wall -Wextra -Wpedantic -Wshadow)
  set(strict $<$<BOOL:${STRETCHMAP_WERROR}>:-Werror>)
  # Nobody reads errno or traps: without them loops with roots and choices can be vectorized.
  target_compile_options(stretchmap_core PRIVATE ${warnings} -fno-math-errno -fno-trapping-math
                                                 ${strict})
  if(NOT x86)
    # The baseline of arm64 has a fused multiply-add: contraction would take the exactness from sums
    # that know their own rounding, those of the predicates first of all.
    target_compile_options(stretchmap_core PRIVATE -ffp-contract=off)
  endif()
endif()

# Kernels for wider processors, chosen at run time. No contraction, so that all of them give the
# same bits; and each by itself: with a precompiled header, or in one unit with others, GCC forgets
# the options for functions of a target of their own.
set(wide cpp/src/volume/tet_weights.cpp cpp/src/volume/tet_weights_avx2.cpp
         cpp/src/volume/tet_weights_avx512.cpp cpp/src/volume/element_energy.cpp
         cpp/src/volume/line_bound.cpp cpp/src/linalg/multigrid/block_products.cpp
         cpp/src/linalg/direct/dense_front.cpp)
if(NOT MSVC)
  set_source_files_properties(
    ${wide} PROPERTIES COMPILE_OPTIONS -ffp-contract=off SKIP_PRECOMPILE_HEADERS ON
                       SKIP_UNITY_BUILD_INCLUSION ON)
  if(x86)
    set_source_files_properties(cpp/src/volume/tet_weights_avx2.cpp PROPERTIES
                                COMPILE_OPTIONS "-ffp-contract=off;-mavx2")
    set_source_files_properties(cpp/src/volume/tet_weights_avx512.cpp PROPERTIES
                                COMPILE_OPTIONS "-ffp-contract=off;-mavx512f")
  endif()
endif()

# With CMAKE_UNITY_BUILD, as wheels are built, each folder is one unit: what its files share of Eigen
# is compiled once.
set_target_properties(stretchmap_core PROPERTIES UNITY_BUILD_MODE GROUP)
foreach(source IN LISTS core_sources)
  get_filename_component(folder "${source}" DIRECTORY)
  string(REGEX REPLACE ".*/cpp/src/" "" folder "${folder}")
  string(REPLACE "/" "_" folder "${folder}")
  set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${folder})
endforeach()

if(STRETCHMAP_SANITIZE)
  target_compile_definitions(stretchmap_core PUBLIC _GLIBCXX_ASSERTIONS)
  target_compile_options(
    stretchmap_core PUBLIC -fsanitize=${STRETCHMAP_SANITIZE} -fno-sanitize-recover=all
                           -fno-omit-frame-pointer -UNDEBUG)
  target_link_options(stretchmap_core PUBLIC -fsanitize=${STRETCHMAP_SANITIZE})
endif()

# Off by default: its supernodal module is under the GPL, and wheels must not depend on it.
if(STRETCHMAP_CHOLMOD)
  find_path(CHOLMOD_INCLUDE_DIR cholmod.h PATH_SUFFIXES suitesparse REQUIRED)
  find_library(CHOLMOD_LIBRARY cholmod REQUIRED)
  target_include_directories(stretchmap_core SYSTEM PRIVATE ${CHOLMOD_INCLUDE_DIR})
  target_link_libraries(stretchmap_core PUBLIC ${CHOLMOD_LIBRARY})
  target_compile_definitions(stretchmap_core PRIVATE STRETCHMAP_CHOLMOD)
endif()
