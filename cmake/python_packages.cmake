# Eigen and pybind11 as the active Python has them: both can come from PyPI, where they lie below
# site-packages and CMake does not look by itself.
if(Python_EXECUTABLE)
  # The cmeel wheels keep their CMake files in a prefix of their own.
  execute_process(
    COMMAND "${Python_EXECUTABLE}" -c
            "import cmeel, pathlib; print(pathlib.Path(cmeel.__file__).parent.parent / 'cmeel.prefix')"
    OUTPUT_VARIABLE prefix OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  if(prefix AND EXISTS "${prefix}")
    list(PREPEND CMAKE_PREFIX_PATH "${prefix}")
  endif()
  execute_process(COMMAND "${Python_EXECUTABLE}" -m pybind11 --cmakedir OUTPUT_VARIABLE directory
                  OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  if(directory AND EXISTS "${directory}" AND NOT pybind11_DIR)
    set(pybind11_DIR "${directory}")
  endif()
endif()
