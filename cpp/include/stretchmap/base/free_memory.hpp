#pragma once

namespace stretchmap {

// Gives back to the system what is free: what one stage has freed in pieces, or in other threads,
// is of no use to the next, and adds to the most a process ever has. Does nothing where the C
// library has no such call.
void give_free_memory_back();

}  // namespace stretchmap
