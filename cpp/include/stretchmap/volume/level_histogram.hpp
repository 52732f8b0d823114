// How amounts carried by the tets is spread over the values of a function of the vertices.
#pragma once

#include "stretchmap/base/types.hpp"

namespace stretchmap::volume {

// (bins, 2) two amounts in the bins of [0, period]. Every tet counts as the four points of the
// quadrature rule of degree two, each with a quarter of its amounts; the function is linear on a
// tet. values (n): values beyond the ends count in the first or last bin. periodic: values are
// angles, say, that agree modulo the period; a tet spans less than half of it. \pre tets index into
// [0, n), amounts (k, 2), bins > 0, period > 0.
Points2 level_histogram(const TetsRef& tets, const VecRef& values, const Points2Ref& amounts,
                        Index bins, double period, bool periodic);

// \param table (bins) a function of the same values, constant in every bin.
// \return (k) its mean over each tet, by the same rule.
Vec level_lookup(const TetsRef& tets, const VecRef& values, const VecRef& table, double period,
                 bool periodic);

}  // namespace stretchmap::volume
