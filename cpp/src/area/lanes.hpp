// What is computed several at a time, one in each lane of the processor's vectors.
#pragma once

namespace stretchmap::area {

constexpr int kLanes = 8;
using Lane = double[kLanes];

}  // namespace stretchmap::area
