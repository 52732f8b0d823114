// Array types shared by every stage. Points and index arrays are row-major, so a NumPy array in C
// order is viewed without a copy. Of Eigen what most files need; decompositions are included where
// they are used.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SparseCore>
#include <cstdint>
#include <functional>

namespace stretchmap {

using Index = std::int32_t;

using Vec = Eigen::VectorXd;
using IndexVec = Eigen::Matrix<Index, Eigen::Dynamic, 1>;
using Flags = Eigen::Matrix<std::uint8_t, Eigen::Dynamic, 1>;

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Points2 = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Edges = Eigen::Matrix<Index, Eigen::Dynamic, 2, Eigen::RowMajor>;
using Faces = Eigen::Matrix<Index, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Tets = Eigen::Matrix<Index, Eigen::Dynamic, 4, Eigen::RowMajor>;
using IndexRows = Eigen::Matrix<Index, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

using PointsRef = Eigen::Ref<const Points>;
using Points2Ref = Eigen::Ref<const Points2>;
using RowsRef = Eigen::Ref<const Rows>;
using EdgesRef = Eigen::Ref<const Edges>;
using FacesRef = Eigen::Ref<const Faces>;
using TetsRef = Eigen::Ref<const Tets>;
using VecRef = Eigen::Ref<const Vec>;
using IndexVecRef = Eigen::Ref<const IndexVec>;
using FlagsRef = Eigen::Ref<const Flags>;

using SparseMatrix = Eigen::SparseMatrix<double, Eigen::RowMajor, Index>;

// Called now and then inside long loops; throws to abort (a keyboard interrupt, say). May be empty.
using Poll = std::function<void()>;

}  // namespace stretchmap
