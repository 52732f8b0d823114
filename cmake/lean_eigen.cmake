# Eigen as it was found, but for the methods of two of its headers, which nothing here calls. Every
# class of an expression declares all methods anew, and the core has thousands of such classes:
# without these, compilers read it in three quarters of the time.
get_target_property(found Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
set(lean "${CMAKE_BINARY_DIR}/lean_eigen")
file(COPY "${found}/Eigen" DESTINATION "${lean}"
     PATTERN IndexedViewMethods.h EXCLUDE
     PATTERN ReshapedMethods.h EXCLUDE)
foreach(header IndexedViewMethods.h ReshapedMethods.h)
  file(CONFIGURE OUTPUT "${lean}/Eigen/src/plugins/${header}" CONTENT "") # as old as it was
endforeach()
set_target_properties(Eigen3::Eigen PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${lean}")
