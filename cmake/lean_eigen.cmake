# Eigen as it was found, but for what costs compilers most and gives this core nothing.
get_target_property(found Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
set(lean "${CMAKE_BINARY_DIR}/lean_eigen")

# Methods that nothing here calls: every class of an expression declares all methods anew, and the
# core has thousands of such classes. Without these, compilers read it in three quarters of the time.
set(unused src/plugins/IndexedViewMethods.h src/plugins/ReshapedMethods.h)
# Types that every such class names anew though its base has them: GCC keeps the names of a type in a
# list, walks it whenever it meets `const` and a new name, and spent a fifth of its reading there on
# thousands of names of `double`. And SVDs, which vectors of three do not need. Versions that may be
# written differently are left as they are.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND Eigen3_VERSION MATCHES "^3[.]4[.][01]$")
  set(shortened
      Geometry src/Core/ArrayBase.h src/Core/Block.h src/Core/DenseBase.h
      src/Core/DenseCoeffsBase.h src/Core/Dot.h src/Core/MapBase.h src/Core/MatrixBase.h
      src/Core/PlainObjectBase.h src/Core/Redux.h src/Core/SolverBase.h src/Core/StableNorm.h
      src/Core/util/Macros.h src/LU/Determinant.h src/SparseCore/SparseRedux.h)
endif()

set(own ${unused} ${shortened})
string(REPLACE ";" "|" own "${own}")
file(COPY "${found}/Eigen" DESTINATION "${lean}" REGEX "/Eigen/(${own})$" EXCLUDE)
foreach(header IN LISTS unused)
  file(CONFIGURE OUTPUT "${lean}/Eigen/${header}" CONTENT "") # as old as it was
endforeach()
set(scalar "typename internal::traits<Derived>::Scalar")
foreach(header IN LISTS shortened)
  file(READ "${found}/Eigen/${header}" text)
  if(header STREQUAL Geometry)
    string(REPLACE "#include \"SVD\"" "" text "${text}")
  elseif(header MATCHES "Block")
    string(REPLACE "typedef typename traits<XprType>::Scalar Scalar;"
                   "using typename traits<XprType>::Scalar;" text "${text}")
  elseif(header MATCHES "Macros")
    foreach(name Scalar RealScalar CoeffReturnType PacketScalar)
      string(REGEX REPLACE "typedef typename [A-Za-z:<>]+ ${name};" "using typename Base::${name};"
                           text "${text}")
    endforeach()
  elseif(header MATCHES "DenseCoeffsBase")
    string(REPLACE "typedef typename NumTraits<Scalar>::Real RealScalar;" "" text "${text}")
  elseif(header MATCHES "SparseRedux")
    string(REGEX REPLACE "typename internal::traits<(Sparse[A-Za-z]+<[^>]+>) >::Scalar"
                         "typename \\1::Scalar" text "${text}")
  elseif(header MATCHES "SolverBase")
    string(REPLACE "typedef Scalar CoeffReturnType;"
                   "typedef Scalar CoeffReturnType; typedef typename NumTraits<Scalar>::Real RealScalar;"
                   text "${text}")
  else()
    foreach(name CoeffReturnType PacketScalar)
      string(REPLACE "typedef typename Base::${name} ${name};" "using typename Base::${name};" text
                     "${text}")
    endforeach()
    if(NOT header MATCHES "DenseBase")
      string(REPLACE "typedef ${scalar} Scalar;" "using typename DenseBase<Derived>::Scalar;" text
                     "${text}")
      string(REPLACE "typedef typename NumTraits<Scalar>::Real RealScalar;"
                     "using typename DenseBase<Derived>::RealScalar;" text "${text}")
      # The same names in front of methods that are defined outside their class.
      string(REGEX REPLACE "typename NumTraits<${scalar}>::Real([ \n]+(#else|MatrixBase<Derived>::))"
                           "typename MatrixBase<Derived>::RealScalar\\1" text "${text}")
      string(REGEX REPLACE "${scalar}([ \n]+MatrixBase<Derived>::)"
                           "typename MatrixBase<Derived>::Scalar\\1" text "${text}")
    endif()
  endif()
  file(CONFIGURE OUTPUT "${lean}/Eigen/${header}" CONTENT "${text}" @ONLY)
endforeach()
set_target_properties(Eigen3::Eigen PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${lean}")
