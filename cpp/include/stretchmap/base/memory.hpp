// What is asked of the system about memory; nothing happens where it knows no such thing.
#pragma once

#include <cstddef>

namespace stretchmap {

// Gives back to the system what is free: what one stage has freed in pieces, or in other threads,
// is of no use to the next, and adds to the most a process ever has.
void give_free_memory_back();

// Large pages for a large array, where there are some on demand: addresses all over it are found
// sooner. Asked before it is first written to.
void prefer_large_pages(const void* begin, std::size_t bytes);

}  // namespace stretchmap
