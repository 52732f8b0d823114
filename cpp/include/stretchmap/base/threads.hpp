// The threads that loops are shared among. Each thread that runs loops has a team of its own, which
// looks out for the next one for some microseconds and then sleeps. Nobody waits for a thread that
// the system does not run just now: chunks that it has not begun are taken by those that run, and
// only what it has begun is waited for.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "stretchmap/base/types.hpp"

namespace stretchmap {

// Processors that this process may run on: no more than its container pays for.
// \param groups folder of the control groups, as the system shows them.
int processors(const std::string& groups = "/sys/fs/cgroup");

// How many threads share the loops of the calling one, itself included: of OMP_NUM_THREADS, else
// one per processor, unless set_thread_count has been called in this thread.
int thread_count();
void set_thread_count(int count);

// For the one thread that a forked process begins with: its team has not come along.
void keep_to_one_thread();

// The chunks of a loop, as one of the threads sees them.
class Shares {
 public:
  // Chunks in [begin, end) that nobody has taken: begin in the upper half.
  struct alignas(64) Range {
    std::atomic<std::uint64_t> ends{0};
  };

  Shares(Range* ranges, int count, int own) : ranges_(ranges), count_(count), own_(own) {}
  // A chunk to compute, -1 if all are taken: from the front of the thread's own range, so that it
  // finds in its cache what it left there, then from the back of those of others.
  Index next();

 private:
  Range* ranges_;
  int count_, own_;
};

using SharedWork = void (*)(void* context, Shares& shares) noexcept;

// Calls work by as many threads as there are, but no more than chunks. A loop inside of a shared
// one is run by the thread that comes to it.
void share_out(Index chunks, SharedWork work, void* context);

// Processor time in seconds that the calling thread has spent in loops that can be shared, however
// many threads there are, since it began to count; the first call begins.
double shared_seconds();

// The same of the helpers of the calling thread, from the first loop on.
double helper_seconds();

}  // namespace stretchmap
