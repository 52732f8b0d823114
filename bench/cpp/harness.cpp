#include "harness.hpp"

#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iomanip>
#include <limits>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "stretchmap/base/parallel.hpp"

#if defined(__unix__) || defined(__APPLE__)
#include <sys/resource.h>
#endif

namespace stretchmap::bench {
namespace {

using Clock = std::chrono::steady_clock;

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return out + '"';
}

std::string number(double value) {
  if (!std::isfinite(value)) return "null";
  std::ostringstream out;
  out << std::setprecision(std::numeric_limits<double>::max_digits10) << value;
  return out.str();
}

std::string now() {
  const std::time_t time = std::time(nullptr);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", std::gmtime(&time));
  return text;
}

}  // namespace

Record measure(const std::string& name, const std::function<void()>& body, double min_seconds,
               int max_runs) {
  Record record;
  record.name = name;
  record.seconds = std::numeric_limits<double>::infinity();
  record.iterations = 0;
  double total = 0.0;
  while (record.iterations < max_runs && (record.iterations == 0 || total < min_seconds)) {
    const std::clock_t cpu = std::clock();
    const auto start = Clock::now();
    body();
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    if (seconds < record.seconds) {
      record.seconds = seconds;
      record.cpu = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
    }
    total += seconds;
    ++record.iterations;
  }
  return record;
}

double peak_resident_bytes() {
#if defined(__unix__) || defined(__APPLE__)
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
#if defined(__APPLE__)
  return static_cast<double>(usage.ru_maxrss);
#else
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
#endif
#else
  return 0.0;
#endif
}

Record copy_bandwidth(int threads) {
  const Index n = 1 << 24;  // 128 MiB per array
  const std::unique_ptr<double[]> from(new double[n]), to(new double[n]);
  for_rows(n, [&](Index i) {
    from[i] = static_cast<double>(i);
    to[i] = 0.0;
  });
  Record record = measure(
      "bandwidth/copy", [&] { for_rows(n, [&](Index i) { to[i] = from[i]; }); }, 1.0, 15);
  record.threads = threads;
  const double bytes = 2.0 * sizeof(double) * static_cast<double>(n);
  record.counters = {{"bytes_per_second", bytes / record.seconds}, {"check", to[n - 1] - (n - 1)}};
  return record;
}

void print_header() {
  std::printf("%-44s %12s %12s %6s  counters\n", "stage", "wall s", "cpu s", "runs");
}

void print(const Record& record) {
  std::printf("%-44s %12.6f %12.6f %6lld ", record.name.c_str(), record.seconds, record.cpu,
              record.iterations);
  for (const auto& [key, value] : record.counters) std::printf(" %s=%.6g", key.c_str(), value);
  std::printf("\n");
  std::fflush(stdout);
}

void write_json(const std::string& path, const Context& context,
                const std::vector<Record>& records) {
  std::ofstream out(path);
  out << "{\n  \"context\": {\n    \"date\": " << quoted(now())
      << ",\n    \"executable\": \"stretchmap_bench\",\n    \"num_cpus\": "
      << std::thread::hardware_concurrency()
#ifdef NDEBUG
      << ",\n    \"library_build_type\": \"release\"";
#else
      << ",\n    \"library_build_type\": \"debug\"";
#endif
  for (const auto& [key, value] : context) out << ",\n    " << quoted(key) << ": " << quoted(value);
  out << "\n  },\n  \"benchmarks\": [";
  for (std::size_t i = 0; i < records.size(); ++i) {
    const Record& r = records[i];
    out << (i ? "," : "") << "\n    {\"name\": " << quoted(r.name) << ", \"family_index\": " << i
        << ", \"per_family_instance_index\": 0, \"run_name\": " << quoted(r.name)
        << ", \"run_type\": \"iteration\", \"repetitions\": 1"
        << ", \"repetition_index\": 0, \"threads\": " << r.threads
        << ", \"iterations\": " << r.iterations << ", \"real_time\": " << number(1e3 * r.seconds)
        << ", \"cpu_time\": " << number(1e3 * r.cpu) << ", \"time_unit\": \"ms\"";
    for (const auto& [key, value] : r.counters) out << ", " << quoted(key) << ": " << number(value);
    out << "}";
  }
  out << "\n  ]\n}\n";
  out.close();
  if (!out) throw std::runtime_error("cannot write " + path);
}

}  // namespace stretchmap::bench
