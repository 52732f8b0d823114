#include "stretchmap/base/threads.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <deque>
#include <fstream>
#include <memory>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#ifdef __linux__
#include <sched.h>
#endif
#if defined(__x86_64__) || defined(_M_X64)
#include <immintrin.h>
#define STRETCHMAP_X86
#endif

namespace stretchmap {
namespace {

constexpr int kMostThreads = 1024;
// Of a thread that waits for the last chunks, before it sleeps: some microseconds.
constexpr int kLooks = 200;

// How long a helper looks out for the next loop before it sleeps: to wake it costs about as much.
constexpr std::chrono::microseconds kWatch{30};
constexpr int kLooksAtOnce = 16;  // between two looks at the clock

// Tells a processor that shares its core that this thread only waits.
void breathe() {
#ifdef STRETCHMAP_X86
  _mm_pause();
#endif
}

std::uint64_t range_of(std::uint64_t begin, std::uint64_t end) { return begin << 32 | end; }

// Whether this thread is in a shared loop: one inside of it is not shared again.
thread_local bool sharing = false;

#ifdef __linux__
// Processors' worth of time that the process may take, rounded up; as good as infinite if nobody
// says. Of control groups version 2, else 1.
int paid_for(const std::string& groups) {
  double quota = 0.0, period = 0.0;  // 0: none, as for "max" and, of version 1, for -1
  if (std::ifstream file(groups + "/cpu.max"); file) {
    file >> quota >> period;
  } else {
    std::ifstream(groups + "/cpu/cpu.cfs_quota_us") >> quota;
    std::ifstream(groups + "/cpu/cpu.cfs_period_us") >> period;
  }
  const double count = quota > 0.0 && period > 0.0 ? std::ceil(quota / period) : kMostThreads;
  return static_cast<int>(std::min<double>(count, kMostThreads));
}
#endif

int default_count() {
  const char* asked = std::getenv("OMP_NUM_THREADS");
  const int count = asked ? std::atoi(asked) : 0;  // up to a comma: that of the outermost level
  return std::clamp(count > 0 ? count : processors(), 1, kMostThreads);
}

// Of the calling thread; wall time where the system does not tell.
double own_seconds() {
#ifdef CLOCK_THREAD_CPUTIME_ID
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
#else
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
#endif
}

// The helpers of one thread. Detached, since a process may end without its threads being told; each
// holds the team as long as it lives.
class Team : public std::enable_shared_from_this<Team> {
 public:
  // As many helpers as asked for, or as the system grants; returns how many there are.
  int hire(int helpers);
  void dismiss();
  void run(Index chunks, int threads, SharedWork work, void* context);
  // Processor time of all helpers in loops.
  double seconds() const { return 1e-9 * static_cast<double>(nanoseconds_.load()); }

 private:
  // State of a loop: its number, whether helpers may still join, how many of them are in it.
  static constexpr std::uint64_t kLoop = 1ull << 32, kOpen = 1ull << 31, kJoined = kOpen - 1;

  struct alignas(64) Bed {
    std::mutex mutex;
    std::condition_variable called;
    std::atomic<bool> taken{false};
  };

  void help(int place, Bed& bed);
  bool join(int place, std::uint64_t& last);
  void leave();
  bool called(int place, std::uint64_t last) const;
  bool watch(int place, std::uint64_t last) const;

  std::atomic<std::uint64_t> state_{0};
  std::atomic<int> threads_{0};  // of the loop, the caller included
  std::atomic<bool> dismissed_{false};
  std::atomic<std::int64_t> nanoseconds_{0};
  // Of an open loop; helpers read them only after they have joined.
  SharedWork work_ = nullptr;
  void* context_ = nullptr;
  std::unique_ptr<Shares::Range[]> ranges_;
  std::deque<Bed> beds_;  // of helpers 1, 2, ...
  std::mutex mutex_;
  std::condition_variable all_left_;
};

int Team::hire(int helpers) {
  const int before = static_cast<int>(beds_.size());
  for (int place = before + 1; place <= helpers; ++place) {
    Bed& bed = beds_.emplace_back();
    try {
      std::thread([team = shared_from_this(), place, &bed] { team->help(place, bed); }).detach();
    } catch (const std::system_error&) {
      beds_.pop_back();
      break;
    }
  }
  const int now = static_cast<int>(beds_.size());
  if (now > before) ranges_ = std::make_unique<Shares::Range[]>(static_cast<std::size_t>(now) + 1);
  return now;
}

void Team::dismiss() {
  dismissed_ = true;
  for (Bed& bed : beds_) {
    { const std::lock_guard<std::mutex> lock(bed.mutex); }
    bed.called.notify_one();
  }
}

void Team::run(Index chunks, int threads, SharedWork work, void* context) {
  for (int i = 0; i < threads; ++i) {
    const auto first = [&](int k) { return static_cast<std::uint64_t>(chunks) * k / threads; };
    ranges_[i].ends.store(range_of(first(i), first(i + 1)), std::memory_order_relaxed);
  }
  work_ = work;
  context_ = context;
  threads_.store(threads, std::memory_order_relaxed);
  state_.store((state_.load() / kLoop + 1) * kLoop | kOpen);
  // A helper lies down before it looks at the state for the last time: one of us sees the other.
  for (int i = 0; i + 1 < threads; ++i) {
    Bed& bed = beds_[i];
    if (!bed.taken) continue;
    { const std::lock_guard<std::mutex> lock(bed.mutex); }
    bed.called.notify_one();
  }
  Shares shares(ranges_.get(), threads, 0);
  work(context, shares);
  std::uint64_t joined = state_.fetch_and(~kOpen) & kJoined;
  for (int look = 0; joined > 0 && look < kLooks; ++look) joined = state_.load() & kJoined;
  if (joined == 0) return;
  std::unique_lock<std::mutex> lock(mutex_);
  all_left_.wait(lock, [&] { return (state_.load() & kJoined) == 0; });
}

// Whether there is a loop that this helper has not been in, or the end.
bool Team::called(int place, std::uint64_t last) const {
  const std::uint64_t state = state_.load();
  return dismissed_ || ((state & kOpen) && state / kLoop != last && place < threads_);
}

bool Team::join(int place, std::uint64_t& last) {
  std::uint64_t state = state_.load();
  while ((state & kOpen) && state / kLoop != last) {
    if (place >= threads_) return false;
    if (!state_.compare_exchange_weak(state, state + 1)) continue;
    last = state / kLoop;
    return true;
  }
  return false;
}

void Team::leave() {
  const std::uint64_t state = state_.fetch_sub(1) - 1;
  if ((state & kOpen) || (state & kJoined)) return;
  { const std::lock_guard<std::mutex> lock(mutex_); }
  all_left_.notify_one();
}

// Whether the next loop comes while this helper looks out for it.
bool Team::watch(int place, std::uint64_t last) const {
  const auto end = std::chrono::steady_clock::now() + kWatch;
  do {
    for (int look = 0; look < kLooksAtOnce; ++look) {
      if (called(place, last)) return true;
      breathe();
    }
  } while (std::chrono::steady_clock::now() < end);
  return false;
}

void Team::help(int place, Bed& bed) {
  sharing = true;
  for (std::uint64_t last = 0; !dismissed_;) {
    if (join(place, last)) {
      const double begin = own_seconds();
      Shares shares(ranges_.get(), threads_, place);
      work_(context_, shares);
      nanoseconds_ += static_cast<std::int64_t>(1e9 * (own_seconds() - begin));
      leave();
      continue;
    }
    if (watch(place, last)) continue;
    std::unique_lock<std::mutex> lock(bed.mutex);
    bed.taken = true;
    bed.called.wait(lock, [&] { return called(place, last); });
    bed.taken = false;
  }
}

// What a thread knows of its own loops.
struct Employer {
  int count = default_count();
  bool forked = false;
  bool counting = false;
  double seconds = 0.0;
  std::shared_ptr<Team> team;

  ~Employer() {
    if (team) team->dismiss();
  }
};

thread_local Employer employer;

}  // namespace

int processors(const std::string& groups) {
#ifdef __linux__
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof allowed, &allowed) == 0)
    return std::min(CPU_COUNT(&allowed), paid_for(groups));
#endif
  return static_cast<int>(std::thread::hardware_concurrency());
}

int thread_count() { return employer.count; }

void set_thread_count(int count) {
  employer.count = employer.forked ? 1 : std::clamp(count, 1, kMostThreads);
}

void keep_to_one_thread() {
  employer.forked = true;
  employer.count = 1;
  // Given up, not dismissed: a helper may have held a lock when it was left behind.
  if (employer.team) new std::shared_ptr<Team>(std::move(employer.team));
}

Index Shares::next() {
  for (int i = 0; i < count_; ++i) {
    std::atomic<std::uint64_t>& range = ranges_[(own_ + i) % count_].ends;
    std::uint64_t left = range.load(std::memory_order_relaxed);
    for (;;) {
      const std::uint64_t begin = left >> 32, end = left & 0xffffffffu;
      if (begin >= end) break;
      const std::uint64_t rest = i == 0 ? range_of(begin + 1, end) : range_of(begin, end - 1);
      if (range.compare_exchange_weak(left, rest, std::memory_order_relaxed))
        return static_cast<Index>(i == 0 ? begin : end - 1);
    }
  }
  return -1;
}

namespace {

void run(Index chunks, SharedWork work, void* context) {
  Employer& own = employer;
  int threads = sharing ? 1 : static_cast<int>(std::min<Index>(own.count, chunks));
  if (threads > 1) {
    if (!own.team) own.team = std::make_shared<Team>();
    threads = std::min(threads, own.team->hire(threads - 1) + 1);
  }
  if (threads < 2) {
    Shares::Range all;
    all.ends.store(range_of(0, std::max<Index>(chunks, 0)), std::memory_order_relaxed);
    Shares shares(&all, 1, 0);
    work(context, shares);
    return;
  }
  sharing = true;
  own.team->run(chunks, threads, work, context);
  sharing = false;
}

}  // namespace

void share_out(Index chunks, SharedWork work, void* context) {
  if (sharing || chunks < 2 || !employer.counting) {
    run(chunks, work, context);
    return;
  }
  const double begin = own_seconds();
  run(chunks, work, context);
  employer.seconds += own_seconds() - begin;
}

double shared_seconds() {
  employer.counting = true;
  return employer.seconds;
}

double helper_seconds() { return employer.team ? employer.team->seconds() : 0.0; }

}  // namespace stretchmap
