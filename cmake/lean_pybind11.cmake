# pybind11 as it was found, but for how it puts the texts of signatures together at compile time: by a
# loop, not by a pack of as many indices as there are letters, which for arrays and their long names
# is a ninth of what the compiler has to do. A version that is written differently is left as it is,
# and CMake says so.
set(lean_pybind11 "${CMAKE_BINARY_DIR}/lean_pybind11")
file(COPY "${pybind11_INCLUDE_DIR}/pybind11" DESTINATION "${lean_pybind11}" PATTERN descr.h EXCLUDE)
file(READ "${pybind11_INCLUDE_DIR}/pybind11/detail/descr.h" found)
string(
  REPLACE "    return plus_impl(a, b, make_index_sequence<N1>(), make_index_sequence<N2>());"
          "    descr<N1 + N2, Ts1..., Ts2...> sum;
    for (size_t i = 0; i < N1; ++i) sum.text[i] = a.text[i];
    for (size_t i = 0; i < N2; ++i) sum.text[N1 + i] = b.text[i];
    return sum;" descr "${found}")
if(descr STREQUAL found)
  message(STATUS "pybind11 ${pybind11_VERSION} is not known here: it is compiled as it is, for longer")
endif()
file(CONFIGURE OUTPUT "${lean_pybind11}/pybind11/detail/descr.h" CONTENT "${descr}" @ONLY)
