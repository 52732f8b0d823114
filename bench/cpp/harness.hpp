// Timing and the report: google/benchmark's JSON schema, written without the library.
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace stretchmap::bench {

struct Record {
  std::string name;      // stage/size/threads:n
  double seconds = 0.0;  // wall clock of one iteration, the best one
  double cpu = 0.0;      // processor time of that iteration, all threads together
  long long iterations = 1;
  int threads = 1;
  std::vector<std::pair<std::string, double>> counters;  // correctness and size columns
};

// Repeats `body` until `min_seconds` have passed, at most `max_runs` times; the best run counts,
// because other work on the machine only ever adds time.
Record measure(const std::string& name, const std::function<void()>& body, double min_seconds = 0.3,
               int max_runs = 20);

// Largest resident set of this process so far, bytes; 0 where the system does not tell.
double peak_resident_bytes();

// Copy bandwidth, bytes read plus bytes written per second, of arrays far larger than any cache.
Record copy_bandwidth(int threads);

using Context = std::vector<std::pair<std::string, std::string>>;

void print_header();
void print(const Record& record);

// \throws std::runtime_error if the file cannot be written.
void write_json(const std::string& path, const Context& context,
                const std::vector<Record>& records);

}  // namespace stretchmap::bench
