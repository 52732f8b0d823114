# The extension module: converts and forwards, so link-time optimization would gain nothing and cost
# every rebuild ten seconds.
find_package(pybind11 CONFIG REQUIRED)
file(GLOB binding_sources CONFIGURE_DEPENDS cpp/bindings/*.cpp)
pybind11_add_module(_core NO_EXTRAS ${binding_sources})
target_link_libraries(_core PRIVATE stretchmap_core)
target_compile_options(_core PRIVATE ${warnings} ${strict})
if(MSVC)
  target_compile_options(_core PRIVATE ${options}) # /bigobj, too, which NO_EXTRAS leaves out
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # pybind11's moves of small matrices look uninitialized to it once they are inlined here.
  target_compile_options(_core PRIVATE -Wno-maybe-uninitialized)
endif()
if(CMAKE_UNITY_BUILD)
  include(cmake/lean_pybind11.cmake)
  target_include_directories(_core SYSTEM BEFORE PRIVATE "${lean_pybind11}")
  if(NOT MSVC)
    # One unit is read faster than a header is precompiled, and to optimize what only converts would
    # take most of the time of an install: calls cost a third of a microsecond more without.
    set_target_properties(_core PROPERTIES UNITY_BUILD_BATCH_SIZE 0)
    target_compile_options(_core PRIVATE $<IF:$<CXX_COMPILER_ID:GNU>,-Og,-O1>)
  endif()
else()
  target_precompile_headers(_core PRIVATE cpp/bindings/arrays.hpp)
endif()
if(STRETCHMAP_INPLACE)
  set_target_properties(_core PROPERTIES LIBRARY_OUTPUT_DIRECTORY
                                         "${CMAKE_SOURCE_DIR}/python/stretchmap")
endif()
install(TARGETS _core LIBRARY DESTINATION stretchmap COMPONENT python)
# What a build that is not in place needs to be imported: cmake --install build/debug --prefix <folder>
install(DIRECTORY python/ DESTINATION . COMPONENT package
        FILES_MATCHING PATTERN "*.py" PATTERN "*.pyi" PATTERN "py.typed")
