# The library of all numerics; knows nothing of Python.
file(GLOB_RECURSE core_sources CONFIGURE_DEPENDS cpp/src/*.cpp)
find_package(Threads REQUIRED)
set(parts stretchmap_core stretchmap_wide)
# Kernels for wider processors, chosen at run time. No contraction, so that all of them give the
# same bits; and a part by itself: with a precompiled header, or in one unit with what may contract,
# GCC forgets the options for functions of a target of their own.
set(wide cpp/src/volume/tet_weights.cpp cpp/src/volume/tet_weights_avx2.cpp
         cpp/src/volume/tet_weights_avx512.cpp cpp/src/volume/element_energy.cpp
         cpp/src/volume/line_bound.cpp cpp/src/linalg/multigrid/block_products.cpp
         cpp/src/linalg/multigrid/level_smoother.cpp
         cpp/src/linalg/direct/dense_front.cpp cpp/src/area/phase_energies.cpp
         cpp/src/area/convex_faces.cpp)
list(TRANSFORM wide PREPEND "${CMAKE_SOURCE_DIR}/")
list(REMOVE_ITEM core_sources ${wide})
add_library(stretchmap_wide OBJECT ${wide})
if(CMAKE_UNITY_BUILD)
  # Units are a few rooms each: what they share of Eigen is compiled once, and so few units read
  # their headers faster than a header is precompiled. Rooms in which a map spends next to no time
  # are a part of their own, optimized less, and so is Eigen's dense algebra.
  set(seldom ${core_sources})
  set(rooms "certificate|forms|homology|mesh|partitions")
  list(FILTER seldom INCLUDE REGEX "/cpp/src/((${rooms})/|linalg/symmetric.cpp)")
  list(FILTER seldom EXCLUDE REGEX "/mesh/size.cpp")
  list(REMOVE_ITEM core_sources ${seldom})
  add_library(stretchmap_seldom OBJECT ${seldom})
  list(APPEND parts stretchmap_seldom)
endif()
add_library(stretchmap_core STATIC ${core_sources})
target_sources(stretchmap_core PRIVATE $<TARGET_OBJECTS:stretchmap_wide>)
foreach(part IN LISTS parts)
  target_include_directories(${part} PUBLIC cpp/include PRIVATE cpp/src)
  target_link_libraries(${part} PUBLIC Eigen3::Eigen Threads::Threads)
  target_compile_definitions(${part} PUBLIC EIGEN_DONT_PARALLELIZE EIGEN_MPL2_ONLY)
endforeach()

if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64" AND NOT CMAKE_OSX_ARCHITECTURES MATCHES "arm64")
  set(x86 ON)
else()
  set(x86 OFF)
endif()
if(MSVC)
  # Templates make more sections than an object file has by default.
  set(warnings /W3)
  set(options ${warnings} /bigobj /utf-8)
else()
  if(NOT CMAKE_UNITY_BUILD) # to look for them is a hundredth of the work, and for developers
    set(warnings -Wall -Wextra -Wpedantic -Wshadow)
  endif()
  set(strict $<$<BOOL:${STRETCHMAP_WERROR}>:-Werror>)
  # Nobody reads errno or traps: without them loops with roots and choices can be vectorized.
  set(options ${warnings} -fno-math-errno -fno-trapping-math ${strict})
  if(NOT x86)
    # The baseline of arm64 has a fused multiply-add: contraction would take the exactness from sums
    # that know their own rounding, those of the predicates first of all.
    list(APPEND options -ffp-contract=off)
  endif()
endif()
foreach(part IN LISTS parts)
  target_compile_options(${part} PRIVATE ${options})
endforeach()

if(NOT MSVC)
  target_compile_options(stretchmap_wide PRIVATE -ffp-contract=off)
  if(x86)
    set_source_files_properties(cpp/src/volume/tet_weights_avx2.cpp PROPERTIES COMPILE_OPTIONS -mavx2)
    set_source_files_properties(cpp/src/volume/tet_weights_avx512.cpp PROPERTIES COMPILE_OPTIONS
                                                                                 -mavx512f)
  endif()
endif()

if(CMAKE_UNITY_BUILD)
  set_target_properties(stretchmap_core PROPERTIES UNITY_BUILD_MODE GROUP)
  set_source_files_properties(${core_sources} PROPERTIES UNITY_GROUP rooms)
  foreach(room area linalg volume)
    set(sources ${core_sources})
    list(FILTER sources INCLUDE REGEX "/cpp/src/${room}/")
    set_source_files_properties(${sources} PROPERTIES UNITY_GROUP ${room})
  endforeach()
  set_target_properties(stretchmap_seldom stretchmap_wide PROPERTIES UNITY_BUILD_BATCH_SIZE 0)
  set_source_files_properties(
    cpp/src/volume/tet_weights_avx2.cpp cpp/src/volume/tet_weights_avx512.cpp
    PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  target_sources(stretchmap_core PRIVATE $<TARGET_OBJECTS:stretchmap_seldom>)
  if(NOT MSVC)
    target_compile_options(stretchmap_seldom PRIVATE -O1)
  endif()
else()
  target_precompile_headers(stretchmap_core PRIVATE <stretchmap/base/types.hpp> <string> <vector>)
endif()

if(STRETCHMAP_SANITIZE)
  foreach(part IN LISTS parts)
    target_compile_definitions(${part} PUBLIC _GLIBCXX_ASSERTIONS)
    target_compile_options(${part} PUBLIC -fsanitize=${STRETCHMAP_SANITIZE} -fno-omit-frame-pointer
                                          -fno-sanitize-recover=all -UNDEBUG)
  endforeach()
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
