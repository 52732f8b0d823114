# Tests of the core by itself, and in a sanitized build those of the package that exercise it.
find_package(doctest CONFIG REQUIRED)
enable_testing()
file(GLOB_RECURSE test_sources CONFIGURE_DEPENDS tests/cpp/*.cpp)
add_executable(stretchmap_tests ${test_sources} bench/cpp/solid_torus.cpp)
target_include_directories(stretchmap_tests PRIVATE tests/cpp bench/cpp cpp/src)
target_link_libraries(stretchmap_tests PRIVATE stretchmap_core doctest::doctest)
target_precompile_headers(stretchmap_tests PRIVATE <doctest/doctest.h>
                                                   <stretchmap/base/types.hpp>)
# What asks for the implementation has to be the first to read the header.
set_source_files_properties(tests/cpp/main.cpp PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
include(doctest)
doctest_discover_tests(stretchmap_tests TEST_PREFIX "cpp: " PROPERTIES LABELS cpp)

if(STRETCHMAP_SANITIZE AND STRETCHMAP_PYTHON)
  # STRETCHMAP_SLOWDOWN: limits of processor time are made for plain builds, see conftest.py.
  # The interpreter is not sanitized: the runtime has to be there before it starts, and the C++
  # library with it, or exceptions cannot be intercepted.
  set(preload "")
  foreach(library asan stdc++)
    execute_process(COMMAND ${CMAKE_CXX_COMPILER} -print-file-name=lib${library}.so
                    OUTPUT_VARIABLE path OUTPUT_STRIP_TRAILING_WHITESPACE)
    string(APPEND preload "${path} ")
  endforeach()
  string(STRIP "${preload}" preload)
  add_test(NAME package COMMAND ${CMAKE_COMMAND} --install "${CMAKE_BINARY_DIR}" --prefix
                                "${CMAKE_BINARY_DIR}/python")
  set_tests_properties(package PROPERTIES FIXTURES_SETUP package)
  foreach(room mesh homology area volume registration)
    add_test(NAME "python: ${room}"
             COMMAND ${Python_EXECUTABLE} -m pytest -q -p no:cacheprovider -m "not timing"
                     tests/python/${room}
             WORKING_DIRECTORY "${CMAKE_SOURCE_DIR}")
    # Python frees nothing when it ends, so leaks are not asked for.
    set_tests_properties(
      "python: ${room}" PROPERTIES FIXTURES_REQUIRED package LABELS python ENVIRONMENT
      "LD_PRELOAD=${preload};ASAN_OPTIONS=detect_leaks=0;STRETCHMAP_SLOWDOWN=25;PYTHONPATH=${CMAKE_BINARY_DIR}/python")
  endforeach()
endif()
