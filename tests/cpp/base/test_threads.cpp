// Loops that threads share: every chunk once, whoever runs and whoever does not.
#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <new>
#include <thread>
#include <vector>

#include "stretchmap/base/parallel.hpp"

TEST_SUITE_BEGIN("base");

namespace {

using stretchmap::Index;

struct ThreadCount {
  int before = stretchmap::thread_count();
  explicit ThreadCount(int count) { stretchmap::set_thread_count(count); }
  ~ThreadCount() { stretchmap::set_thread_count(before); }
};

double harmonic_sum(Index n) {
  return stretchmap::sum_chunks<1>(n, [](Index begin, Index end, std::array<double, 1>& sums) {
    for (Index i = begin; i < end; ++i) sums[0] += 1.0 / (1.0 + i);
  })[0];
}

}  // namespace

TEST_CASE("every row is visited once by any number of threads") {
  for (const int threads : {1, 2, 3, 8}) {
    const ThreadCount count(threads);
    for (const Index n : {0, 1, 5, 64, 1000}) {
      std::vector<std::atomic<int>> visits(static_cast<std::size_t>(n));
      for (int again = 0; again < 200; ++again)
        stretchmap::for_rows(n, 8, [&](Index i) { ++visits[i]; });
      for (const std::atomic<int>& seen : visits) REQUIRE(seen == 200);
    }
  }
}

TEST_CASE("sums have the same bits with any number of threads") {
  const double one = (ThreadCount(1), harmonic_sum(100000));
  for (const int threads : {2, 3, 7}) {
    const ThreadCount count(threads);
    for (int again = 0; again < 50; ++again) REQUIRE(harmonic_sum(100000) == one);
  }
}

TEST_CASE("a thread that does not come on is left no more than the chunk it is at") {
  const ThreadCount count(2);
  const std::thread::id own = std::this_thread::get_id();
  std::atomic<bool> helped{false};
  std::atomic<int> by_helper{0}, by_caller{0};
  stretchmap::for_tasks(100, [&](Index) {
    if (std::this_thread::get_id() == own) {
      ++by_caller;
      for (int i = 0; by_caller == 1 && !helped && i < 1000; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      return;
    }
    ++by_helper;
    helped = true;
    while (by_caller < 99) std::this_thread::yield();
  });
  CHECK(by_helper == 1);
  CHECK(by_caller == 99);
}

TEST_CASE("a loop in a shared loop, and loops of several threads at once") {
  const ThreadCount count(3);
  std::vector<double> sums(6, 0.0);
  stretchmap::for_tasks(6, [&](Index task) { sums[task] = harmonic_sum(20000); });
  for (const double sum : sums) CHECK(sum == sums[0]);
  std::vector<std::thread> callers;
  for (int k = 0; k < 6; ++k)
    callers.emplace_back([&sums, k] {
      const ThreadCount own(2 + k % 3);
      for (int again = 0; again < 100; ++again) sums[k] += harmonic_sum(20000);
    });
  for (std::thread& caller : callers) caller.join();
  for (const double sum : sums) CHECK(sum == sums[0]);
}

TEST_CASE("a loop of one chunk stays with the thread that begins it") {
  const ThreadCount count(4);
  const std::thread::id own = std::this_thread::get_id();
  bool alone = true;
  stretchmap::for_rows(stretchmap::kChunk, [&](Index) {
    if (std::this_thread::get_id() != own) alone = false;
  });
  CHECK(alone);
}

TEST_CASE("what a shared loop throws is thrown once all threads are done, and the next one runs") {
  for (const int threads : {1, 4}) {
    const ThreadCount count(threads);
    for (int round = 0; round < 20; ++round) {
      CHECK_THROWS_AS(stretchmap::for_tasks(64,
                                            [](Index task) {
                                              if (task % 2) throw std::bad_alloc();
                                            }),
                      std::bad_alloc);
      std::atomic<int> done{0};
      stretchmap::for_tasks(64, [&](Index) { ++done; });
      CHECK(done == 64);
    }
  }
}

TEST_CASE("what helpers compute is counted with the thread they help, and with no other") {
  const ThreadCount count(2);
  const auto busy_until_both_came = [] {
    std::atomic<int> here{0};
    stretchmap::for_tasks(2, [&](Index) {
      ++here;
      while (here < 2) std::this_thread::yield();
      harmonic_sum(1'000'000);
    });
  };
  const double before = stretchmap::helper_seconds();
  double others = 0.0, own = 0.0;
  std::thread([&] {
    stretchmap::set_thread_count(2);
    others = stretchmap::helper_seconds();
    busy_until_both_came();
    own = stretchmap::helper_seconds();
  }).join();
  CHECK(others == 0.0);
  CHECK(own > 0.0);
  CHECK(stretchmap::helper_seconds() == before);
  busy_until_both_came();
  CHECK(stretchmap::helper_seconds() > before);
}

TEST_CASE("time in shared loops is counted with one thread, too") {
  const ThreadCount count(1);
  const double before = stretchmap::shared_seconds();
  const double small = harmonic_sum(stretchmap::kChunk);
  CHECK(stretchmap::shared_seconds() == before);
  CHECK(harmonic_sum(100 * stretchmap::kChunk) > small);
  CHECK(stretchmap::shared_seconds() > before);
}
